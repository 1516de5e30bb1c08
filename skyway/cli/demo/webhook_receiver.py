"""A customer's webhook receiver for the demo: checks each signature, keeps what arrived."""

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


class WebhookReceiver:
    """An HTTP server on loopback; what arrives waits in `notifications`."""

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
                """Say nothing: the terminal belongs to the demo."""

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)

    @property
    def url(self) -> str:
        """Where the customer wants to be told."""
        return f"http://127.0.0.1:{self._server.server_port}/skyway"

    def accept(self, headers: dict[str, str], body: bytes) -> None:
        """Check and keep one notification; called on a thread of the server."""
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
