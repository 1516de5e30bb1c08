"""`skyway_client` against a server that refuses, hangs up and breaks its streams.

The server answers each request with the next of its planned answers, and keeps what came.
"""

import asyncio
import json
import sys
import threading
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import httpx
from skyway_client import AsyncSkyway, Skyway, SkywayError, problems
from skyway_client.api.deliveries import cancel_delivery, create_delivery, list_deliveries
from skyway_client.models import CancelRequest, OfferChoice

CHOICE = create_delivery(body=OfferChoice(quote_id="quo_1", offer_id="off_1"))
CANCEL = cancel_delivery("dlv_1", body=CancelRequest())
LIST = list_deliveries()


class Planned(NamedTuple):
    """An answer; without a status the connection is closed instead."""

    status: int = 0
    body: str = "{}"
    headers: Mapping[str, str] = MappingProxyType({})


def problem(status: int, name: str, code: str | None = None, **headers: str) -> Planned:
    """A refusal."""
    members = {"type": f"urn:skyway:problem:{name}", "status": status, "title": name, "code": code}
    return Planned(status, json.dumps(members), headers)


PAGE = Planned(200, '{"items": [], "next_cursor": null}')
HANG_UP = Planned()
BUSY = problem(503, "service-unavailable", **{"Retry-After": "0"})
LIMITED = problem(429, "too-many-requests", **{"Retry-After": "0"})


class Server(BaseHTTPRequestHandler):
    """Answers as planned."""

    planned: ClassVar[list[Planned]] = []
    came: ClassVar[list[dict[str, str]]] = []

    def answer(self) -> None:
        self.rfile.read(int(self.headers.get("content-length", 0)))
        self.came.append({name.lower(): value for name, value in self.headers.items()})
        planned = self.planned.pop(0)
        self.close_connection = True
        if not planned.status:
            return
        self.send_response(planned.status)
        for name, value in planned.headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(planned.body.encode())

    def do_GET(self) -> None:
        self.answer()

    def do_POST(self) -> None:
        self.answer()

    def log_message(self, *_: object) -> None:
        """Say nothing."""


def meets(url: str, act: Callable[[Skyway], Any], *planned: Planned) -> tuple[Any, int]:
    """What comes of an act when the server answers so, and how many requests it took."""
    Server.planned[:], before = planned, len(Server.came)
    with Skyway(url, "sk_1") as skyway:
        try:
            result = act(skyway)
        except (SkywayError, httpx.TransportError) as error:
            result = error
    assert not Server.planned
    return result, len(Server.came) - before


def check_repetitions(url: str) -> None:
    """Only what does nothing twice is repeated, with the same key."""
    lost = problem(409, "conflict", "OFFER_LOST")
    result, requests = meets(url, lambda skyway: skyway.send(CHOICE), HANG_UP, BUSY, lost)
    assert isinstance(result, problems.OfferLost)
    assert requests == 3
    assert len({came["idempotency-key"] for came in Server.came[-3:]}) == 1
    result, requests = meets(url, lambda skyway: skyway.send(CANCEL), HANG_UP)
    assert isinstance(result, httpx.TransportError)
    result, requests = meets(url, lambda skyway: skyway.send(CANCEL), LIMITED, BUSY)
    assert isinstance(result, problems.ServiceUnavailable)
    result, requests = meets(url, lambda skyway: list(skyway.each(LIST)), HANG_UP, LIMITED, PAGE)
    assert result == []
    late = problem(503, "service-unavailable", **{"Retry-After": "3600"})
    result, requests = meets(url, lambda skyway: skyway.send(LIST), late)
    assert result.retry_after_s == 3600


def check_errors(url: str) -> None:
    """Each refusal has the class of its code, of its type, or the common one."""
    unknown = problem(409, "conflict", "NEW_CODE")
    assert type(meets(url, lambda skyway: skyway.send(LIST), unknown)[0]) is problems.Conflict
    foreign = Planned(502, "<html>")
    assert type(meets(url, lambda skyway: skyway.send(LIST), foreign)[0]) is SkywayError


EVENT = {
    "message_id": "msg_1",
    "sent_at": "2026-03-02T09:16:00Z",
    "event_id": "evt_1",
    "type": "delivery.started",
    "delivery_id": "dlv_1",
    "sequence": 7,
    "occurred_at": "2026-03-02T09:16:00Z",
    "data": {"mission_id": "mis_1", "provider_id": "prv_1", "drone_id": "drn_1"},
}


def check_streams(url: str) -> None:
    """A stream that breaks is opened again after its last event, sync and async."""
    frame = f"id: 7\nevent: delivery.started\ndata: {json.dumps(EVENT)}\n\n"
    headers = {"Content-Type": "text/event-stream", "Content-Length": "9999"}
    planned = (BUSY, Planned(200, frame, headers), Planned(204, ""))
    events, _ = meets(url, lambda skyway: list(skyway.events("dlv_1", after=6)), *planned)
    assert [event.sequence for event in events] == [7]
    assert [came["last-event-id"] for came in Server.came[-3:]] == ["6", "6", "7"]
    Server.planned[:] = planned
    assert asyncio.run(collected(url)) == events


async def collected(url: str) -> list[Any]:
    """The events of the async client."""
    async with AsyncSkyway(url, "sk_1") as skyway:
        return [event async for event in skyway.events("dlv_1", after=6)]


def main() -> None:
    """Run all checks."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), Server)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    url = f"http://127.0.0.1:{server.server_port}"
    for check in (check_repetitions, check_errors, check_streams):
        check(url)
    server.shutdown()
    sys.stdout.write("GOOD\n")


if __name__ == "__main__":
    main()
