"""Customers' webhooks: where they point, what is due, and each signed attempt.

`webhook` says what a webhook is, how its notifications are signed and when they are tried again.
`send_webhooks` is the loop: `sending_store` claims what is due, `post_webhook` sends it to an
address that `targets` allows. `replay_events` queues past events again.
"""
