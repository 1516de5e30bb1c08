"""How customers are notified: each delivery event in sequence, by webhook, SSE and MQTT.

`delivery_events` writes events for all channels in one transaction, with the SQL of `event_store`,
and serves server-sent events. `webhooks` sends to customers' endpoints, and `fleet_time` publishes
the fleet clock.
"""
