"""The gateway: the one public face. It owns deliveries, quotes, notifications and API keys.

Rooms: `deliveries` (from request to last package), `quotes` (offers before that), `notifications`
(what customers are told, by webhook, SSE and MQTT), `access` (who is calling), `forward` (calls
that other services answer), `audit` (what operators and providers did), `statistics`.
Read `deliveries.book` first.
"""
