"""An app whose database is away at its start answers 503 until it is open."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route

from skyway.runtime.errors import DamagedDatabase, ServiceUnavailable, UnsafeDatabase
from skyway.runtime.http.opening import Opening
from skyway.runtime.loops import Loops

AWAY = ServiceUnavailable("database", "no connection")


async def answer(_request: Request) -> PlainTextResponse:
    return PlainTextResponse("here")


class Life:
    """A server's part of the ASGI lifespan of an app that meets these errors when it opens."""

    def __init__(self, *errors: Exception) -> None:
        self.errors = list(errors)
        self.opened = asyncio.Event()
        self.may_open = asyncio.Event()
        self.may_open.set()
        self.breaks = asyncio.Event()
        self.closed = 0
        self.has_left = asyncio.Event()
        self._messages: asyncio.Queue[dict[str, str]] = asyncio.Queue()
        self._sent: asyncio.Queue[str] = asyncio.Queue()
        paths = ("/deliveries", "/healthz")
        app = Starlette(routes=[Route(path, answer) for path in paths], lifespan=self._lifespan)
        self.opening = Opening(app)
        self.opening.when_failed(self.has_left.set)
        self._running: asyncio.Task[None] | None = None

    @asynccontextmanager
    async def _lifespan(self, _app: Starlette) -> AsyncIterator[None]:
        await self.may_open.wait()
        if self.errors:
            raise self.errors.pop(0)
        async with Loops() as loops:
            loops.start("breaks", self._break())
            self.opened.set()
            yield
        self.closed += 1

    async def _break(self) -> None:
        await self.breaks.wait()
        raise LookupError("a bug in a loop")

    async def start(self) -> None:
        self._messages.put_nowait({"type": "lifespan.startup"})
        self._running = asyncio.create_task(
            self.opening({"type": "lifespan"}, self._messages.get, self._send)
        )
        assert await self._sent.get() == "lifespan.startup.complete"

    async def stop(self) -> None:
        self._messages.put_nowait({"type": "lifespan.shutdown"})
        assert await self._sent.get() == "lifespan.shutdown.complete"
        assert self._running is not None
        await self._running

    async def get(self, path: str) -> httpx.Response:
        transport = httpx.ASGITransport(self.opening)
        async with httpx.AsyncClient(transport=transport, base_url="http://app") as client:
            return await client.get(path)

    async def _send(self, message: Any) -> None:
        self._sent.put_nowait(message["type"])


@asynccontextmanager
async def started(*errors: Exception) -> AsyncIterator[Life]:
    life = Life(*errors)
    async with asyncio.timeout(60):
        await life.start()
        yield life
        await life.stop()


async def test_an_open_app_answers_and_is_closed_once() -> None:
    async with started() as life:
        answered = await life.get("/deliveries")

    assert (answered.text, life.closed, life.opening.failure) == ("here", 1, None)


async def test_an_app_that_waits_for_its_database_says_so_and_is_opened_again() -> None:
    async with started(AWAY, AWAY) as life:
        life.may_open.clear()
        refused, alive = await life.get("/deliveries"), await life.get("/healthz")
        life.may_open.set()
        await life.opened.wait()
        answered = await life.get("/deliveries")

    assert (refused.status_code, refused.headers["retry-after"]) == (503, "1")
    assert refused.json()["detail"] == "database is unavailable: no connection"
    assert (alive.status_code, answered.status_code) == (200, 200)
    assert life.opening.failure is None


@pytest.mark.parametrize(
    "error", [DamagedDatabase("broken page"), UnsafeDatabase("no WAL"), LookupError("a bug")]
)
async def test_an_app_that_can_never_open_fails_and_its_server_leaves(error: Exception) -> None:
    async with started(error) as life:
        await life.has_left.wait()

    assert life.opening.failure is error


async def test_an_app_without_its_loops_fails_and_answers_no_more() -> None:
    async with started() as life:
        life.breaks.set()
        await life.has_left.wait()
        refused = await life.get("/deliveries")

    assert refused.status_code == 503
    assert isinstance(life.opening.failure, ExceptionGroup)


async def test_an_app_that_still_waits_can_be_stopped() -> None:
    async with started(*[AWAY] * 1000) as life:
        pass

    assert (life.closed, life.opening.failure) == (0, None)
