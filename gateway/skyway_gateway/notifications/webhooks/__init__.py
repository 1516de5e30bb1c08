"""Customers' webhooks: where they point, what is due, and each signed attempt.

`webhook` says what a webhook is, how its notifications are signed and when they are tried again.
`send_webhooks` is the loop: `webhook_store` claims what is due, `post_webhook` checks the address
and sends it there. `replay_store` queues past events again.
"""
