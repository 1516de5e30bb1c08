"""Flights over a made-up map, a list of stations over real HTTP, and a book that reads it."""

import asyncio
import json
import threading
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest
from skyway_drone_agent.enrolment.cloud import CloudAccess
from skyway_drone_agent.landing_book.book import LandingBook, StationReader
from skyway_drone_agent.landing_book.station_cache import StationCacheFile

from skyway.contracts.flight_step import FlyStep
from skyway.contracts.world import NetworkVersion
from skyway.geo import Position
from skyway.ids import NetworkId, StationId

NOW = datetime(2026, 3, 1, 12, tzinfo=UTC)

#: Stations in a line, and one beside it that is on nobody's way.
PLACES = {"home": (-98.0, 30.0), "shop": (-97.9, 30.0), "barn": (-97.95, 30.02)}


def _flight(
    start: str = "home", end: str = "shop", places: dict[str, tuple[float, float]] | None = None
) -> FlyStep:
    where = PLACES if places is None else places
    return FlyStep(
        step_id=1,
        planned_start_at=NOW,
        planned_end_at=NOW,
        from_id=StationId(start),
        to_id=StationId(end),
        from_position=Position(*where[start]),
        to_position=Position(*where[end]),
        length_m=10_000,
        lands=True,
    )


def _version(number: int = 1, network_id: str = "texas") -> NetworkVersion:
    return NetworkVersion(
        message_id=f"msg_{number}",
        sent_at=NOW,
        network_id=NetworkId(network_id),
        version=number,
        sha256=f"hash {number}",
        href="",
    )


@dataclass
class FakeCloud:
    """The list of one network's stations; pages are short, and boxes as they are asked for."""

    url: str = ""
    places: dict[str, tuple[float, float]] = field(default_factory=lambda: dict(PLACES))
    closed: set[str] = field(default_factory=set)
    keys: set[str] = field(default_factory=lambda: {"dk_1"})
    network_id: str = "texas"
    page: int = 2
    is_down: bool = False
    asked: list[str] = field(default_factory=list)

    def answer(self, target: str, key: str) -> tuple[int, Any]:
        parts = urlsplit(target)
        query = parse_qs(parts.query)
        self.asked.append(parts.path)
        if self.is_down:
            return 503, {"code": "", "detail": "down in this test"}
        if key not in self.keys:
            return 401, {"code": "", "detail": "not known"}
        if parts.path != f"/v1/networks/{self.network_id}/stations":
            return 404, {"code": "NOT_FOUND", "detail": parts.path}
        west, south, east, north = (float(number) for number in query["bbox"][0].split(","))
        after = query.get("cursor", [""])[0]
        found = [
            {"station_id": name, "position": place, "is_closed": name in self.closed, "pads": 2}
            for name, place in sorted(self.places.items())
            if west <= place[0] <= east and south <= place[1] <= north and name > after
        ]
        shown = found[: self.page]
        more = str(shown[-1]["station_id"]) if len(found) > self.page else None
        return 200, {"items": shown, "next_cursor": more}


@pytest.fixture
def cloud() -> Iterator[FakeCloud]:
    fake = FakeCloud()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            key = str(self.headers.get("Authorization", "")).removeprefix("Bearer ")
            status, answer = fake.answer(self.path, key)
            self.send_response(status)
            self.end_headers()
            self.wfile.write(json.dumps(answer).encode())

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        fake.url = f"http://127.0.0.1:{server.server_address[1]}"
        serving = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        serving.start()
        yield fake
        server.shutdown()
        serving.join()


MakeBook = Callable[..., LandingBook]


@pytest.fixture
def make_book(cloud: FakeCloud, tmp_path: Path) -> MakeBook:
    """Makes books of the same drone on the same disk."""

    def make(*keys: str, **settings: Any) -> LandingBook:
        accesses = [CloudAccess(cloud.url, key) for key in keys or ("dk_1",)]
        return LandingBook(
            StationReader(accesses), StationCacheFile(tmp_path / "landing-book.json"), **settings
        )

    return make


async def _reads(book: LandingBook, claim: Callable[[], bool]) -> None:
    """Let the book read until the claim holds; then its process ends."""
    reading = asyncio.create_task(book.run())
    try:
        async with asyncio.timeout(60):
            while not claim():  # noqa: ASYNC110 - no event announces it
                await asyncio.sleep(0.005)
    finally:
        reading.cancel()
        await asyncio.wait((reading,))


@pytest.fixture
def flight() -> Callable[..., FlyStep]:
    """Makes flights between places, by their names."""
    return _flight


@pytest.fixture
def version() -> Callable[..., NetworkVersion]:
    """Makes versions of a network, by their numbers."""
    return _version


@pytest.fixture
def reads() -> Callable[..., Awaitable[None]]:
    """Runs a book."""
    return _reads
