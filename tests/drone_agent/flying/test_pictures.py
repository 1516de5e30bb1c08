"""A drone that waits for a PHOTO uploads a picture, again and again until the cloud takes it."""

import asyncio
import contextlib
import threading
from collections.abc import AsyncIterator, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest
from skyway_drone_agent.flying.pictures import PictureSender
from skyway_drone_agent.journal.logbook import CurrentMission
from skyway_drone_agent.journal.records import Answer
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle

from skyway.ids import DeliveryId, MissionId

#: Real seconds after which a test gives up.
_LIMIT_S = 10.0


class Uploads:
    """A gateway that takes pictures at addresses that it knows."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.url = ""
        self.answers = [204]
        self.came: asyncio.Queue[tuple[str, str, bytes]] = asyncio.Queue()
        self._loop = loop

    def accept(self, path: str, kind: str, body: bytes) -> int:
        self._loop.call_soon_threadsafe(self.came.put_nowait, (path, kind, body))
        return self.answers.pop(0)

    async def next(self) -> tuple[str, str, bytes]:
        return await asyncio.wait_for(self.came.get(), _LIMIT_S)


@pytest.fixture
async def uploads() -> AsyncIterator[Uploads]:
    made = Uploads(asyncio.get_running_loop())
    with _serving(made):
        yield made


@contextlib.contextmanager
def _serving(made: Uploads) -> Iterator[None]:
    class Handler(BaseHTTPRequestHandler):
        def do_PUT(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            self.send_response(made.accept(self.path, self.headers["Content-Type"], body))
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        made.url = f"http://127.0.0.1:{server.server_address[1]}"
        serving = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        serving.start()
        yield
        server.shutdown()
        serving.join()


@pytest.fixture
async def waiting(desk: Any, drone: Any, steps: Any, uploads: Uploads) -> AsyncIterator[Any]:
    """The desk of a drone that waits at the shop for a PHOTO of p1 and a PIN of p2."""
    proven_by = {"p1": "PHOTO", "p2": "PIN"}
    (step,) = steps().deliver("shop", *proven_by, recipient_wait_s=300, **proven_by).made
    now = desk.clock.now()
    mission = CurrentMission(
        mission_id=MissionId("msn_1"),
        revision=1,
        delivery_id=DeliveryId("dlv_1"),
        accepted_by=Answer(instruction_id="ins_1", stream=1, seq=1, status="ACCEPTED"),
        expires_at=now,
        first_step=1,
        steps=(step,),
        released_through=1,
        free_at=now,
        began_at=now,
    )
    desk.drone_is(mission=mission, station_id="shop")
    vehicle = SimulatedVehicle(drone.model, desk.clock)
    sender = PictureSender(desk.recorder, vehicle, desk.clock, api_url=uploads.url)
    sending = asyncio.ensure_future(sender.run())
    yield desk
    sending.cancel()
    await asyncio.wait((sending,))


async def pause_of(desk: Any) -> None:
    """Wait until the sender pauses, and end its pause."""
    async with asyncio.timeout(_LIMIT_S):
        while (moment := desk.clock.next_moment()) is None:  # noqa: ASYNC110 - the sender sleeps on this clock
            await asyncio.sleep(0)
    desk.clock.move_to(moment)


async def test_a_drone_uploads_a_jpeg_to_the_address_of_the_photo(
    waiting: Any, uploads: Uploads
) -> None:
    path, kind, picture = await uploads.next()

    assert (path, kind) == ("/up/p1", "image/jpeg")
    assert picture.startswith(b"\xff\xd8\xff")
    await pause_of(waiting)
    assert uploads.came.empty()


async def test_a_refused_picture_is_sent_again(uploads: Uploads, waiting: Any) -> None:
    uploads.answers = [409, 503, 204]

    for _ in range(2):
        await uploads.next()
        await pause_of(waiting)

    assert (await uploads.next())[0] == "/up/p1"
