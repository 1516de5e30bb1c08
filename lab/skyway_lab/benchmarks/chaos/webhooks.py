"""The customers' server for webhooks: keeps everything in the order of its arrival."""

import base64
import hashlib
import hmac
import secrets
import time
from collections import defaultdict
from collections.abc import Mapping
from typing import Final, Self

from aiohttp import web
from skyway_lab.benchmarks.chaos.evidence import Received
from skyway_lab.benchmarks.load.follow import LAST_EVENTS

from skyway.contracts.delivery_event import DeliveryEvent
from skyway.ids import DeliveryId

_HOST: Final = "127.0.0.1"


class WebhookServer:
    """An HTTP server on loopback; each customer has a path and a secret.

    Another system may still notify the last owner of this port. The paths of a run are its own,
    and calls of any other path are answered 404.
    """

    def __init__(self) -> None:
        self._run = secrets.token_hex(8)
        self._secrets: dict[str, str] = {}
        self._runner: web.AppRunner | None = None
        self.received: dict[DeliveryId, list[Received]] = defaultdict(list)

    async def __aenter__(self) -> Self:
        app = web.Application()
        app.router.add_post(f"/{self._run}/{{customer}}", self._answer)
        self._runner = web.AppRunner(app, access_log=None)
        await self._runner.setup()
        await web.TCPSite(self._runner, _HOST, 0).start()
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._runner is not None:
            await self._runner.cleanup()

    @property
    def address(self) -> tuple[str, int]:
        """Where it listens."""
        if self._runner is None:
            raise RuntimeError("the webhooks' server is not started")
        port: int = self._runner.addresses[0][1]
        return (_HOST, port)

    def path_of(self, customer: str) -> str:
        """Where this customer's notifications must be sent."""
        return f"/{self._run}/{customer}"

    def add(self, customer: str, secret: str) -> None:
        """Check the signatures at this customer's path with this secret."""
        self._secrets[customer] = secret

    def has_ended(self, delivery_id: DeliveryId) -> bool:
        """Whether the last event of a delivery has arrived."""
        return any(one.event.type in LAST_EVENTS for one in self.received.get(delivery_id, ()))

    async def _answer(self, request: web.Request) -> web.Response:
        body = await request.read()
        event = DeliveryEvent.model_validate_json(body)
        secret = self._secrets.get(request.match_info["customer"], "")
        received = Received(event, time.monotonic(), _is_signed(secret, request.headers, body))
        self.received[event.delivery_id].append(received)
        return web.Response(status=204)


def _is_signed(secret: str, headers: Mapping[str, str], body: bytes) -> bool:
    """Whether the signature of Standard Webhooks is right and names this body."""
    key = base64.b64decode(secret.removeprefix("whsec_"))
    stamp = headers.get("webhook-timestamp", "")
    signed = f"{headers.get('webhook-id', '')}.{stamp}.".encode() + body
    expected = base64.b64encode(hmac.digest(key, signed, hashlib.sha256)).decode()
    return f"v1,{expected}" in headers.get("webhook-signature", "").split(" ")
