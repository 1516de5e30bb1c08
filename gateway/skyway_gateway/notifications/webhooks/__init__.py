"""Customers' webhooks: where they point, what is due, and each signed attempt.

`send_webhooks` is the loop: `sending_store` claims what is due, `post_webhook` sends it to an
address that `targets` allows, `retry_schedule` says when to try again. `replay_events` queues past
events again.
"""
