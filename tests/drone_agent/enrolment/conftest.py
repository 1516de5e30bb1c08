"""A cloud over real HTTP that exchanges tokens and rotates as the registry does."""

import json
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest


@dataclass
class FakeCloud:
    """The registry's rules of enrolment; `loses` the next answers, after doing what was asked."""

    drone: dict[str, Any]
    url: str = ""
    tokens: set[str] = field(default_factory=lambda: {"enr_good"})
    keys: dict[str, str] = field(default_factory=dict)
    answered: dict[str, dict[str, Any]] = field(default_factory=dict)
    loses: int = 0
    is_down: bool = False
    is_busy: bool = False
    asked: list[str] = field(default_factory=list)
    public_keys: list[str] = field(default_factory=list)
    made: int = 0

    @property
    def password(self) -> str:
        """What the broker takes now."""
        return self.keys["password"]

    def answer(self, method: str, path: str, headers: Any, body: Any) -> tuple[int, Any]:
        self.asked.append(f"{method} {path}")
        if body is not None and "public_key" in body:
            self.public_keys.append(body["public_key"])
        bearer = str(headers.get("Authorization", "")).removeprefix("Bearer ")
        if self.is_busy:
            return 429, {"code": "ADDRESS_REQUESTS", "detail": "spent in this test"}
        if self.is_down:
            return 503, {"code": "", "detail": "down in this test"}
        if (method, path) == ("POST", "/v1/enrolments"):
            return self._enrol(str(body["enrolment_token"]), headers.get("Idempotency-Key"))
        if bearer and bearer == self.keys.get("next"):
            self.keys = {"key": bearer, "password": self.keys["next_password"]}
        if not bearer or bearer != self.keys.get("key"):
            return 401, {"code": "", "detail": "not known"}
        if path == "/v1/enrolments/rotations":
            given = self._new()
            self.keys |= {"next": given["key"], "next_password": given["mqtt"]["password"]}
            return 201, given
        return 200, {"drone_id": "drn_1"}

    def _enrol(self, token: str, idempotency_key: str | None) -> tuple[int, Any]:
        if idempotency_key in self.answered:
            return 201, self.answered[idempotency_key]
        if token not in self.tokens:
            return 409, {"code": "TOKEN_USED", "detail": "used before"}
        self.tokens.remove(token)
        given = self.drone | self._new()
        self.keys = {"key": given["key"], "password": given["mqtt"]["password"]}
        if idempotency_key:
            self.answered[idempotency_key] = given
        return 201, given

    def _new(self) -> dict[str, Any]:
        self.made += 1
        return {
            "key": f"dk_{self.made}",
            "mqtt": {"user_name": "drn_1", "password": f"password {self.made}"},
            "mqtt_urls": [f"mqtt://node-{self.made}:1883"],
        }


@pytest.fixture
def cloud(drone: Any) -> Iterator[FakeCloud]:
    fake = FakeCloud(json.loads(drone.model_dump_json()))

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self._do()

        def do_POST(self) -> None:
            self._do()

        def log_message(self, *_: object) -> None:
            pass

        def _do(self) -> None:
            raw = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            status, answer = fake.answer(
                self.command, self.path, self.headers, json.loads(raw or b"null")
            )
            if fake.loses > 0:
                fake.loses -= 1
                self.close_connection = True
                return
            self.send_response(status)
            self.end_headers()
            self.wfile.write(json.dumps(answer).encode())

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        fake.url = f"http://127.0.0.1:{server.server_address[1]}"
        serving = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        serving.start()
        yield fake
        server.shutdown()
        serving.join()
