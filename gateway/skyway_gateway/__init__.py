"""The gateway: the one public face. It owns deliveries, quotes, notifications and API keys.

Rooms: `deliveries` (from request to last package), `quotes` (offers before a delivery),
`notifications` (events for customers, by webhook, SSE and MQTT), `access` (who is calling, and the
audit log), `forward` (calls that other services answer), `retention` (deletes what is old). Read
`deliveries.booking.book` first.
"""
