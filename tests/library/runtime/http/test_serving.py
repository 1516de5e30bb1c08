"""A service under a parent process: the socket outlives the service, which ends with its parent."""

import asyncio
import os
import signal
import socket
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest

CHILD = """
import sys
from types import SimpleNamespace
from starlette.applications import Starlette
from starlette.responses import StreamingResponse
from starlette.routing import Route
from skyway.runtime.http.serving import serve
import asyncio, os

async def forever():
    yield b"begun"
    await asyncio.Event().wait()

async def answer(request):
    if request.url.path == "/stream":
        return StreamingResponse(forever())
    return StreamingResponse(iter([str(os.getpid())]))

socket_fd, parent_fd = (int(text) if text != "-" else None for text in sys.argv[1:3])
app = Starlette(routes=[Route("/{path:path}", answer)])
settings = SimpleNamespace(host="127.0.0.1", port=0, socket_fd=socket_fd, parent_fd=parent_fd)
sys.exit(serve(app, settings))
"""

BROKEN_CHILD = CHILD.replace("routes=", "lifespan=lambda app: 1 / 0, routes=")
WAIT_S = 60.0


class Parent:
    """Holds the listening socket and one end of the pipe, and starts children on them."""

    def __init__(self, script: Path) -> None:
        self._script = script
        self._socket = socket.create_server(("127.0.0.1", 0))
        self._socket.set_inheritable(True)
        self._child_end, self._own_end = os.pipe()
        self.children: list[asyncio.subprocess.Process] = []
        self.url = f"http://127.0.0.1:{self._socket.getsockname()[1]}"

    async def start(self, source: str = CHILD) -> asyncio.subprocess.Process:
        self._script.write_text(source)
        fds = (self._socket.fileno(), self._child_end)
        arguments = (sys.executable, str(self._script), *map(str, fds))
        child = await asyncio.create_subprocess_exec(
            *arguments, pass_fds=fds, stderr=asyncio.subprocess.DEVNULL
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


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
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


async def test_a_bug_at_the_start_ends_the_service_with_exit_code_1(parent: Parent) -> None:
    child = await parent.start(BROKEN_CHILD)

    assert await asyncio.wait_for(child.wait(), WAIT_S) == 1
