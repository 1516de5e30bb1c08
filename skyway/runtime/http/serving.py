"""Serves an app until the parent ends, on the socket of the parent, so that no request is lost."""

import asyncio
import os
import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, Protocol

import uvicorn
import uvloop
from starlette.applications import Starlette

from skyway.runtime.exit_codes import ExitCode
from skyway.runtime.garbage import keep_what_is_loaded
from skyway.runtime.http.opening import Opening

#: Without it an open SSE stream would delay the exit for ever.
_GRACE_S: Final = 2


class ServingSettings(Protocol):
    """Where to listen, and which parent process to end with; `ServiceSettings` has it all."""

    @property
    def host(self) -> str:
        """The address to bind when no socket was passed."""
        ...

    @property
    def port(self) -> int:
        """The port to bind when no socket was passed; 0 takes any."""
        ...

    @property
    def socket_fd(self) -> int | None:
        """A listening socket passed by the parent."""
        ...

    @property
    def parent_fd(self) -> int | None:
        """The reading end of a pipe that the parent holds open while it lives."""
        ...


def serve(app: Starlette, settings: ServingSettings) -> int:
    """The exit code of the process, after serving until a signal comes or the parent leaves.

    Raises
    ------
    SkywayError
        The app can never be opened.
    """
    opening = Opening(app)
    config = uvicorn.Config(
        opening,
        host=settings.host,
        port=settings.port,
        log_config=None,
        access_log=False,
        server_header=False,
        lifespan="on",
        ws="none",  # an Upgrade is ignored, and the request is answered
        timeout_graceful_shutdown=_GRACE_S,
    )
    server = _Server(config)
    opening.when_failed(server.leave)
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        return runner.run(_serve(server, opening, settings))


class _Server(uvicorn.Server):
    """A server that ends by returning: uvicorn's own raises the signal again and ends with -15."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self.leave)
        try:
            yield
        finally:
            for number in (signal.SIGINT, signal.SIGTERM):
                loop.remove_signal_handler(number)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        keep_what_is_loaded()

    def leave(self) -> None:
        """Stop accepting, finish what is under way, and return."""
        self.should_exit = True


async def _serve(server: _Server, opening: Opening, settings: ServingSettings) -> int:
    with _leaving_with_parent(server, settings.parent_fd):
        try:
            await server.serve(_passed_sockets(settings.socket_fd))
        except SystemExit:
            # uvicorn has logged why it cannot listen.
            return ExitCode.NOT_NOW
    if opening.failure is not None:
        raise opening.failure
    return ExitCode.ENDED


def _passed_sockets(socket_fd: int | None) -> list[socket.socket] | None:
    if socket_fd is None:
        return None
    # Processes that this one starts must not hold the socket after it has gone.
    os.set_inheritable(socket_fd, False)
    return [socket.socket(fileno=socket_fd)]


@contextmanager
def _leaving_with_parent(server: _Server, parent_fd: int | None) -> Iterator[None]:
    if parent_fd is None:
        yield
        return
    os.set_inheritable(parent_fd, False)
    loop = asyncio.get_running_loop()

    def on_readable() -> None:
        if not os.read(parent_fd, 1024):
            loop.remove_reader(parent_fd)
            server.leave()

    loop.add_reader(parent_fd, on_readable)
    try:
        yield
    finally:
        loop.remove_reader(parent_fd)
