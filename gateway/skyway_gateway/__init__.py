"""The gateway: the one public face. It owns deliveries, notifications and API keys.

Rooms: `deliveries` (from request to last package), `notifications` (what customers are told, by
webhook, SSE and MQTT), `access` (who is calling), `forward` (calls that other services answer).
Read `deliveries.book` first.
"""
