"""A gateway on loopback that answers as a test says, and the keys to it."""

import json
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest


class Gateway(ThreadingHTTPServer):
    """Answers each call as `answers` says, and records all calls.

    A key of `answers` is a method and a path, without its query or with it; a value is a status and
    a body. A body is JSON, or the bytes to send; `headers` has the headers of such bytes.
    """

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.answers: dict[tuple[str, str], tuple[int, Any]] = {}
        self.headers: dict[bytes, dict[str, str]] = {}
        self.calls: list[tuple[str, str, Any]] = []
        #: The queries of the calls that have one.
        self.queries: list[str] = []
        #: The key of each call.
        self.keys: list[str] = []

    @property
    def called(self) -> list[tuple[str, str]]:
        """Methods and paths of all calls."""
        return [(method, path) for method, path, _ in self.calls]


class _Handler(BaseHTTPRequestHandler):
    server: Gateway

    def do_GET(self) -> None:
        raw = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        path, _, query = self.path.partition("?")
        if query:
            self.server.queries.append(query)
        self.server.calls.append((self.command, path, json.loads(raw) if raw else None))
        self.server.keys.append(self.headers.get("Authorization", "").removeprefix("Bearer "))
        answers = self.server.answers
        unknown = (404, {"detail": "no route"})
        without_query = answers.get((self.command, path), unknown)
        status, body = answers.get((self.command, self.path), without_query)
        content, headers = body, {"Content-Type": "application/json"}
        if isinstance(body, bytes):
            headers = self.server.headers.get(body, {})
        else:
            content = json.dumps(body).encode()
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    do_POST = do_GET  # noqa: N815 - the standard library names it
    do_PUT = do_GET  # noqa: N815 - the standard library names it
    do_PATCH = do_GET  # noqa: N815 - the standard library names it
    do_DELETE = do_GET  # noqa: N815 - the standard library names it

    def log_request(self, *_: Any) -> None:
        """Keep the test's output free of requests."""


@pytest.fixture
def answering_gateway(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Gateway]:
    """A gateway, and a data folder whose keys.env names it and a broker that does not answer."""
    for name in ("GATEWAY_URL", "OPERATOR_KEY", "PROVIDER_KEY", "CUSTOMER_KEY", "MQTT_URL"):
        monkeypatch.delenv(f"SKYWAY_{name}", raising=False)
    monkeypatch.delenv("SKYWAY_OWN_MQTT_URL", raising=False)
    monkeypatch.setenv("SKYWAY_DATA", str(tmp_path))
    with Gateway() as server:
        keys = {
            "GATEWAY_URL": f"http://127.0.0.1:{server.server_port}",
            "OPERATOR_KEY": "sk_operator",
            "CUSTOMER_KEY": "sk_customer",
            "MQTT_URL": "mqtt://127.0.0.1:9",
        }
        lines = [f"export SKYWAY_{name}={value}\n" for name, value in keys.items()]
        (tmp_path / "keys.env").write_text("".join(lines))
        (tmp_path / "secrets").mkdir()
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield server
        server.shutdown()
        thread.join()
