"""Serves an app until the parent ends, on the socket of the parent, so that no request is lost.

The process tries to open what the app needs until that succeeds. Meanwhile the app answers 503. So
callers of a service whose database is away at the start get an answer, and the service works as
soon as the database does. If the process ended instead, callers would wait without an answer, and
the service would need a restart.
"""

import asyncio
import logging
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Final

import uvicorn
import uvloop
from starlette.applications import Starlette
from starlette.types import Message, Receive, Scope, Send

from skyway.runtime.errors import FOR_GOOD, ExitCode, ServiceUnavailable, exit_code_of
from skyway.runtime.http.front_limits import ConnectionTable, FrontLimits
from skyway.runtime.http.front_protocol import FrontProtocol
from skyway.runtime.http.problems import problem_of, problem_response
from skyway.runtime.loading import keep_what_is_loaded
from skyway.runtime.loops import MissingParts, missing_part, pause_s, stop_signals
from skyway.runtime.settings import ServiceSettings

log = logging.getLogger(__name__)

#: Seconds that open answers get at the end: an SSE stream would delay the exit for ever.
_GRACE_S: Final = 2


#: Requests wait this long for the app to open, wall seconds. After that they are answered with 503.
_REQUESTS_WAIT_S: Final = 3.0

#: What cancelled requests are answered.
_STOPS: Final = ServiceUnavailable("service", "it stops")

#: These need nothing that has to be opened.
_ALWAYS_ANSWERED: Final = ("/healthz", "/metrics")


def serve(app: Starlette, settings: ServiceSettings) -> int:
    """Serve until a signal comes or the parent ends; returns the exit code.

    Raises
    ------
    SkywayError
        The app can never be opened.
    """
    opening = Opening(app)
    limits = FrontLimits.of(settings)
    table = ConnectionTable(limits, trusted_proxies=settings.trusted_proxies)
    config = uvicorn.Config(
        opening,
        # uvicorn wants a class, and calls it.
        http=partial(FrontProtocol, limits=limits, table=table),  # type: ignore[arg-type]
        host=settings.host,
        port=settings.port,
        log_config=None,
        access_log=False,
        server_header=False,
        # uvicorn's own default would trust every process of this machine.
        proxy_headers=bool(settings.trusted_proxies),
        forwarded_allow_ips=settings.trusted_proxies,
        lifespan="on",
        ws="none",  # an Upgrade is ignored, and the request is answered
        timeout_graceful_shutdown=_GRACE_S + 1,  # `_end_answers` comes first
    )
    server = _Server(config)
    opening.when_failed(server.leave)
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        return runner.run(_serve(server, opening, settings))


class _Server(uvicorn.Server):
    """A server that ends by returning: uvicorn's own raises the signal again and ends with -15."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        with stop_signals(lambda _reason: self.leave()):
            yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        keep_what_is_loaded()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        ending = asyncio.get_running_loop().call_later(_GRACE_S, self._end_answers)
        await super().shutdown(sockets)
        ending.cancel()

    def _end_answers(self) -> None:
        for task in self.server_state.tasks:
            task.cancel()

    def leave(self) -> None:
        """Stop accepting, finish what is under way, and return."""
        self.should_exit = True


async def _serve(server: _Server, opening: "Opening", settings: ServiceSettings) -> int:
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


class Opening:
    """An ASGI app around the app of a service, whose lifespan it opens and keeps open.

    When the lifespan can never be opened, or ends by an error, `failure` holds the error. The
    server must leave then: a process must not go on answering without its loops.
    """

    def __init__(self, app: Starlette) -> None:
        self._app = app
        self._leave: Callable[[], None] | None = None
        self._is_open = False
        self._waits_for = ServiceUnavailable("service", "it is starting")
        self._may_answer = asyncio.Event()
        self._closing = asyncio.Event()
        self.failure: Exception | None = None

    def when_failed(self, leave: Callable[[], None]) -> None:
        """Call this once the app can no longer serve."""
        self._leave = leave

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request, or the whole life of the app."""
        if scope["type"] == "lifespan":
            await self._live(receive, send)
        elif self._is_open or scope["path"] in _ALWAYS_ANSWERED:
            await self._answer(scope, receive, send)
        else:
            await problem_response(problem_of(self._waits_for))(scope, receive, send)

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request; a server that stops cancels it, and it still ends as HTTP asks."""
        has_begun, has_ended = False, False

        async def note(message: Message) -> None:
            nonlocal has_begun, has_ended
            has_begun = True
            await send(message)
            has_ended = message["type"] == "http.response.body" and not message.get("more_body")

        try:
            await self._app(scope, receive, note)
        except asyncio.CancelledError:
            if not has_begun:
                await problem_response(problem_of(_STOPS))(scope, receive, send)
            elif not has_ended:
                await send({"type": "http.response.body"})

    async def _live(self, receive: Receive, send: Send) -> None:
        await receive()
        keeper = asyncio.create_task(self._keep_open())
        try:
            async with asyncio.timeout(_REQUESTS_WAIT_S):
                await self._may_answer.wait()
        except TimeoutError:
            log.warning("start takes long")
        await send({"type": "lifespan.startup.complete"})
        await receive()
        self._closing.set()
        if not self._is_open:
            keeper.cancel()
        await asyncio.wait([keeper])
        await send({"type": "lifespan.shutdown.complete"})

    async def _keep_open(self) -> None:
        missing, failures = MissingParts("start"), 0
        while not self._closing.is_set():
            try:
                await self._live_once(missing)
            except Exception as error:  # noqa: BLE001 - the outermost frame of the app's life
                part = missing_part(error)
                if part is None or exit_code_of(error) in FOR_GOOD or self._is_open:
                    self._fail(error)
                    return
                failures += 1
                missing.note(error)
                self._waits_for = part
                self._may_answer.set()
                await asyncio.sleep(pause_s(failures))

    async def _live_once(self, missing: MissingParts) -> None:
        """Open everything, and close it when the server ends."""
        async with self._app.router.lifespan_context(self._app):
            self._is_open = True
            missing.are_back()
            self._may_answer.set()
            await self._closing.wait()
        self._is_open = False

    def _fail(self, error: Exception) -> None:
        self._is_open = False
        self.failure = error
        self._may_answer.set()
        if self._leave is not None:
            self._leave()
