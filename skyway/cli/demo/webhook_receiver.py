"""A customer's webhook receiver for the demo: checks signatures and puts webhooks in order."""

import asyncio
import base64
import hashlib
import hmac
import json
import threading
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Self


@dataclass(frozen=True, slots=True)
class Notification:
    """One webhook as it arrived."""

    webhook_id: str
    event: dict[str, Any]  # the delivery event's JSON
    is_signed: bool


class NotificationOrder:
    """Puts webhooks in the order of their moments.

    A webhook can arrive after one of a later moment: a drone reports the end of a step a little
    after composition has changed the plan. So each is held for `hold_s` seconds after its arrival.
    """

    def __init__(self, *, hold_s: float) -> None:
        self._hold_s = hold_s
        self._held: list[tuple[str, int, float, Notification]] = []

    def add(self, notification: Notification, *, arrived_s: float) -> None:
        """Hold a webhook that arrived at this moment of a monotonic clock."""
        event = notification.event
        self._held.append((event["occurred_at"], event["sequence"], arrived_s, notification))
        self._held.sort(key=lambda held: held[:2])

    def due(self, now_s: float) -> list[Notification]:
        """The webhooks that were held long enough, and all of earlier moments; they are let go."""
        due = 0
        for place, (_, _, arrived_s, _) in enumerate(self._held, start=1):
            if now_s - arrived_s >= self._hold_s:
                due = place
        return self._release(due)

    def remaining(self) -> list[Notification]:
        """All webhooks that are still held; they are let go."""
        return self._release(len(self._held))

    def _release(self, number: int) -> list[Notification]:
        released, self._held = self._held[:number], self._held[number:]
        return [notification for *_, notification in released]


class WebhookReceiver:
    """An HTTP server on loopback; webhooks that arrived wait in `notifications`."""

    def __init__(self) -> None:
        self.notifications: asyncio.Queue[Notification] = asyncio.Queue()
        self.secret = ""
        self._loop = asyncio.get_running_loop()
        receiver = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                length = int(self.headers.get("Content-Length", 0))
                receiver.accept(dict(self.headers), self.rfile.read(length))
                self.send_response(204)
                self.end_headers()

            def log_message(self, *_: object) -> None:
                """Print nothing: the terminal belongs to the demo."""

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)

    @property
    def url(self) -> str:
        """The address to which the gateway sends webhooks."""
        return f"http://127.0.0.1:{self._server.server_port}/skyway"

    def accept(self, headers: dict[str, str], body: bytes) -> None:
        """Check a webhook and put it into the queue; the server's threads call this."""
        lowered = {name.lower(): value for name, value in headers.items()}
        webhook_id = lowered.get("webhook-id", "")
        signed = f"{webhook_id}.{lowered.get('webhook-timestamp', '')}.".encode() + body
        expected = f"v1,{_signature(self.secret, signed)}"
        is_signed = expected in lowered.get("webhook-signature", "").split(" ")
        notification = Notification(webhook_id, json.loads(body), is_signed)
        self._loop.call_soon_threadsafe(self.notifications.put_nowait, notification)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


def _signature(secret: str, signed: bytes) -> str:
    key = base64.b64decode(secret.removeprefix("whsec_"))
    return base64.b64encode(hmac.digest(key, signed, hashlib.sha256)).decode()
