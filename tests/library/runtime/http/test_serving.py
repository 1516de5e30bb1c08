"""The server of an app, and an app whose database is away at its start."""

import asyncio
import os
import signal
import socket
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route

from skyway.runtime.errors import DamagedDatabase, ServiceUnavailable, UnsafeDatabase
from skyway.runtime.http.serving import Opening
from skyway.runtime.loops import Loops
from tests.long_cases import sampled

CHILD = """
import sys
from types import SimpleNamespace
from starlette.applications import Starlette
from starlette.responses import StreamingResponse
from starlette.routing import Route
from skyway.runtime.http.serving import serve
from skyway.runtime.tracing import configure_logs
import asyncio, os

async def forever():
    yield b"begun"
    await asyncio.Event().wait()

async def answer(request):
    if request.url.path == "/stream":
        return StreamingResponse(forever())
    if request.url.path == "/wait":
        print("waits", flush=True)
        await asyncio.Event().wait()
    return StreamingResponse(iter([str(os.getpid())]))

configure_logs("child", "INFO")
socket_fd, parent_fd = (int(text) if text != "-" else None for text in sys.argv[1:3])
app = Starlette(routes=[Route("/{path:path}", answer)])
settings = SimpleNamespace(host="127.0.0.1", port=0, socket_fd=socket_fd, parent_fd=parent_fd,
    trusted_proxies="", http_connections=100, http_connections_per_address=50,
    http_url_bytes=8192, http_head_bytes=32768, http_head_s=10.0, http_body_s=30.0)
sys.exit(serve(app, settings))
"""

BROKEN_CHILD = CHILD.replace("routes=", "lifespan=lambda app: 1 / 0, routes=")
WAIT_S = 60.0


class Parent:
    """Holds the listening socket and one end of the pipe, and starts children on them."""

    def __init__(self, script: Path) -> None:
        self._script = script
        self.log = script.with_suffix(".log")
        self._socket = socket.create_server(("127.0.0.1", 0))
        self._socket.set_inheritable(True)
        self._child_end, self._own_end = os.pipe()
        self.children: list[asyncio.subprocess.Process] = []
        self.url = f"http://127.0.0.1:{self._socket.getsockname()[1]}"

    async def start(self, source: str = CHILD) -> asyncio.subprocess.Process:
        self._script.write_text(source)
        fds = (self._socket.fileno(), self._child_end)
        arguments = (sys.executable, str(self._script), *map(str, fds))
        with self.log.open("w") as log:
            child = await asyncio.create_subprocess_exec(
                *arguments, pass_fds=fds, stdout=asyncio.subprocess.PIPE, stderr=log
            )
        self.children.append(child)
        return child

    def leave(self) -> None:
        os.close(self._own_end)
        self._own_end = -1

    async def close(self) -> None:
        for child in self.children:
            if child.returncode is None:
                child.kill()
            await child.wait()
        self._socket.close()
        os.close(self._child_end)
        if self._own_end != -1:
            os.close(self._own_end)


@pytest.fixture
async def parent(tmp_path: Path) -> AsyncIterator[Parent]:
    holder = Parent(tmp_path / "child.py")
    yield holder
    await holder.close()


async def test_a_request_waits_through_a_kill_and_a_restart(parent: Parent) -> None:
    first = await parent.start()
    async with httpx.AsyncClient(base_url=parent.url, timeout=WAIT_S, trust_env=False) as client:
        assert (await client.get("/")).text == str(first.pid)
        first.kill()
        await first.wait()

        waiting = asyncio.create_task(client.get("/"))
        second = await parent.start()

        assert (await waiting).text == str(second.pid)


async def test_a_request_with_an_unsupported_upgrade_is_answered(
    parent: Parent,
) -> None:
    child = await parent.start()
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket"}
    async with httpx.AsyncClient(base_url=parent.url, timeout=WAIT_S, trust_env=False) as client:
        answer = await client.get("/", headers=upgrade)

    assert answer.text == str(child.pid)


async def test_a_service_leaves_with_its_parent(parent: Parent) -> None:
    child = await parent.start()
    async with httpx.AsyncClient(base_url=parent.url, timeout=WAIT_S, trust_env=False) as client:
        await client.get("/")

    parent.leave()

    assert await asyncio.wait_for(child.wait(), WAIT_S) == 0


@pytest.mark.parametrize("number", sampled([signal.SIGTERM, signal.SIGINT, signal.SIGHUP], every=3))
async def test_a_signal_ends_a_service_in_order_though_a_stream_is_open(
    parent: Parent, number: signal.Signals
) -> None:
    child = await parent.start()
    async with (
        httpx.AsyncClient(base_url=parent.url, timeout=WAIT_S, trust_env=False) as client,
        client.stream("GET", "/stream") as stream,
    ):
        parts = stream.aiter_text()
        assert await anext(parts) == "begun"

        child.send_signal(number)

        assert await asyncio.wait_for(child.wait(), WAIT_S) == 0


async def test_a_stop_ends_what_is_under_way_as_http_asks_and_logs_no_error(
    parent: Parent,
) -> None:
    child = await parent.start()
    assert child.stdout is not None
    async with (
        httpx.AsyncClient(base_url=parent.url, timeout=WAIT_S, trust_env=False) as client,
        client.stream("GET", "/stream") as stream,
    ):
        parts = stream.aiter_text()
        assert await anext(parts) == "begun"
        waiting = asyncio.create_task(client.get("/wait"))
        assert await child.stdout.readline() == b"waits\n"

        child.send_signal(signal.SIGTERM)

        assert [part async for part in parts] == []
        refused = await waiting
        assert await asyncio.wait_for(child.wait(), WAIT_S) == 0
    assert (refused.status_code, refused.headers["retry-after"]) == (503, "1")
    assert "asked to stop" in parent.log.read_text()
    assert "ERROR" not in parent.log.read_text()


async def test_a_bug_at_the_start_ends_the_service_with_exit_code_1(parent: Parent) -> None:
    child = await parent.start(BROKEN_CHILD)

    assert await asyncio.wait_for(child.wait(), WAIT_S) == 1


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
    "error",
    [
        DamagedDatabase("broken page"),
        ExceptionGroup("tasks", [AWAY, DamagedDatabase("broken page")]),
        UnsafeDatabase("no WAL"),
        LookupError("a bug"),
    ],
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
