"""Order deliveries from Skyway: typed, sync and async.

`skyway_client.api` has a module for each part of the API, with a function for each operation. A
function makes a call, which a client sends: `skyway.send(create_delivery(body=...))`.
"""

from skyway_client.client import AsyncSkyway, Skyway
from skyway_client.errors import SkywayError
from skyway_client.webhooks import NotVerified, read_notification

__all__ = ["AsyncSkyway", "NotVerified", "Skyway", "SkywayError", "read_notification"]
