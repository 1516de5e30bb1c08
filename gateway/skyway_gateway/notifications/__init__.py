"""How customers are notified: each delivery event in sequence, by webhook, SSE and MQTT.

`delivery_events` writes events for all channels in one transaction, with the SQL of `event_store`,
and serves server-sent events. `fleet_time` publishes the fleet clock.

`webhook` says what a customer's webhook is, how its notifications are signed and when they are
tried again. `send_webhooks` is the loop: `webhook_store` claims what is due, `post_webhook` checks
the address and sends it there. `replay_store` queues past events again.
"""
