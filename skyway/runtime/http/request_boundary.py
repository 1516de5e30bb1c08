"""The outermost frame of every request: its trace, its size, and its uncaught errors."""

import asyncio
import logging
import time
from collections.abc import Callable, Mapping
from typing import Final

from fastapi import Request
from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect
from starlette.routing import compile_path
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from skyway.contracts.problem_details import ProblemDetails
from skyway.runtime.errors import TooLarge
from skyway.runtime.http.problems import our_failure, problem_of, problem_response, status_problem
from skyway.runtime.metrics import count
from skyway.runtime.tracing import tracing

log = logging.getLogger(__name__)

#: The most bytes of a request body (docs/reference/rest.md); single routes take more.
BODY_LIMIT_BYTES: Final = 256 * 1024

#: A refused body is read up to here: a client that is cut off while it sends gets no answer.
_DRAINED_BYTES: Final = 8 * 1024 * 1024
_DRAIN_S: Final = 2.0

_METHODS: Final = frozenset({"GET", "POST", "PUT", "PATCH", "DELETE", "HEAD", "OPTIONS"})

BodyLimit = Callable[[Request], int]


def body_limits(larger: Mapping[str, int]) -> BodyLimit:
    """256 KiB, except for the `larger` routes, named like ``PUT /v1/networks/{network_id}``."""
    routes = tuple(
        (method, compile_path(path)[0], limit_bytes)
        for (method, path), limit_bytes in ((name.split(" "), n) for name, n in larger.items())
    )

    def limit_of(request: Request) -> int:
        fitting = (
            limit_bytes
            for method, pattern, limit_bytes in routes
            if method == request.method and pattern.match(request.scope["path"])
        )
        return next(fitting, BODY_LIMIT_BYTES)

    return limit_of


class RequestBoundary:
    """ASGI middleware: continues the trace, limits the body, answers uncaught errors."""

    def __init__(self, app: ASGIApp, body_limit: BodyLimit) -> None:
        self._app = app
        self._body_limit = body_limit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope)
        started_at = time.monotonic()
        with tracing(request.headers.get("traceparent")):
            exchange = _Exchange(self._body_limit(request), scope, receive, send)
            await self._serve(request, exchange)
        _count_request(request, exchange.status, time.monotonic() - started_at)

    async def _serve(self, request: Request, exchange: "_Exchange") -> None:
        if "\0" in request.scope["path"] or b"%00" in request.scope["query_string"]:
            problem = status_problem(400, "the path and the query may not hold U+0000")
            await exchange.answer(problem)
        elif _announced_bytes(request) > exchange.limit_bytes:
            await exchange.refuse_body()
        else:
            try:
                await self._app(request.scope, exchange.receive, exchange.send)
            except ClientDisconnect:
                log.info("client left", extra={"path": request.scope["path"]})
            except Exception:  # noqa: BLE001 - the outermost frame of a request: log and answer
                await _answer_uncaught(request, exchange)


class _Exchange:
    """One request and its answer, with the body counted as it comes in."""

    def __init__(self, limit_bytes: int, scope: Scope, receive: Receive, send: Send) -> None:
        self.limit_bytes = limit_bytes
        self.status = 0
        self._scope = scope
        self._receive = receive
        self._send = send
        self._received_bytes = 0
        self._is_body_complete = False

    async def receive(self) -> Message:
        """The next part of the body, unless it goes over the limit."""
        message = await self._receive()
        if message["type"] == "http.request":
            self._received_bytes += len(message.get("body", b""))
            self._is_body_complete = not message.get("more_body", False)
        if self._received_bytes > self.limit_bytes:
            raise TooLarge(self.limit_bytes)
        return message

    async def send(self, message: Message) -> None:
        """Pass the answer on. If the body is too large, the answer is always 413."""
        if self.status == 0 and self._received_bytes > self.limit_bytes:
            await self.refuse_body()
        elif self._received_bytes <= self.limit_bytes:
            self.status = self.status or message["status"]
            await self._send(message)

    async def refuse_body(self) -> None:
        """Answer 413, after reading what the client is still sending."""
        # A client that sent Expect still waits with its body; reading would ask for the body.
        if "expect" not in Headers(scope=self._scope):
            await self._drain()
        await self.answer(problem_of(TooLarge(self.limit_bytes)))

    async def answer(self, problem: ProblemDetails) -> None:
        """Answer with a problem document."""
        self.status = problem.status
        await problem_response(problem)(self._scope, self._receive, self._send)

    async def _drain(self) -> None:
        drained_bytes = 0
        try:
            async with asyncio.timeout(_DRAIN_S):
                while not self._is_body_complete and drained_bytes < _DRAINED_BYTES:
                    message = await self._receive()
                    drained_bytes += len(message.get("body", b""))
                    self._is_body_complete = not message.get("more_body", False)
        except TimeoutError:
            log.info("refused body goes on", extra={"drained_bytes": drained_bytes})


async def _answer_uncaught(request: Request, exchange: _Exchange) -> None:
    place = {"method": request.method, "path": request.scope["path"]}
    log.exception("request failed", extra=place)
    if exchange.status == 0:
        await exchange.answer(our_failure())


def _announced_bytes(request: Request) -> int:
    announced = request.headers.get("content-length", "0")
    return int(announced) if announced.isdecimal() else 0


def _count_request(request: Request, status: int, elapsed_s: float) -> None:
    route = getattr(request.scope.get("route"), "path", "")
    # The client chooses the method: counting unknown ones could make any number of series.
    method = request.method if request.method in _METHODS else "OTHER"
    code = str(status)
    count("skyway_http_requests", "requests", method=method, route=route, status=code)
    name, about = "skyway_http_request_seconds", "time spent on requests"
    count(name, about, elapsed_s, method=method, route=route, status=code)
