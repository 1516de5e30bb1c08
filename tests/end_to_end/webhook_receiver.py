"""A customer's server that receives webhooks."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any

from tests.end_to_end.eventually import eventually


@dataclass
class WebhookReceiver:
    """What was received: the headers, in small letters, and the event of each request."""

    url: str = ""
    received: list[tuple[dict[str, str], dict[str, Any]]] = field(default_factory=list)

    def of(self, delivery_id: str) -> list[tuple[dict[str, str], dict[str, Any]]]:
        """What was received about one delivery."""
        return [each for each in list(self.received) if each[1]["delivery_id"] == delivery_id]

    def until_received(self, event_type: str, delivery_id: str) -> None:
        """Return once an event of this type of the delivery has come."""
        eventually(
            lambda: any(event["type"] == event_type for _, event in self.of(delivery_id)),
            f"webhook {event_type}",
            instead=lambda: self.of(delivery_id),
        )


@contextmanager
def webhook_receiver() -> Iterator[WebhookReceiver]:
    """A receiver that listens while the block runs, and answers 204."""
    receiver = WebhookReceiver()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            headers = {name.lower(): value for name, value in self.headers.items()}
            receiver.received.append((headers, json.loads(body)))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    receiver.url = f"http://127.0.0.1:{server.server_port}/hook"
    thread = Thread(target=server.serve_forever)
    thread.start()
    try:
        yield receiver
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
