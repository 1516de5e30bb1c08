"""Opens what an app needs, again and again until it succeeds. Meanwhile the app answers 503.

A service whose database is away at its start thus tells its callers so, and is back as soon as the
database is. If it ended instead, its callers would wait without an answer, and it would be back
only after a restart.
"""

import asyncio
import logging
from collections.abc import Callable
from typing import Final

from starlette.applications import Starlette
from starlette.types import Receive, Scope, Send

from skyway.runtime.errors import DamagedDatabase, ServiceUnavailable
from skyway.runtime.http.problems import problem_of, problem_response
from skyway.runtime.loops import MissingParts, missing_part, pause_s

log = logging.getLogger(__name__)

#: Requests wait this long for the app to open, wall seconds. After that they are answered with 503.
_REQUESTS_WAIT_S: Final = 3.0

#: These need nothing that has to be opened.
_ALWAYS_ANSWERED: Final = ("/healthz", "/metrics")


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
            await self._app(scope, receive, send)
        else:
            await problem_response(problem_of(self._waits_for))(scope, receive, send)

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
                if part is None or isinstance(part, DamagedDatabase) or self._is_open:
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
