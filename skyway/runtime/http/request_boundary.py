"""The outermost frame of every request: its trace, its caller, its size, its uncaught errors.

The entrance checks the caller before any of the body is read, so that the body of an unknown caller
costs nothing.
"""

import asyncio
import logging
import time
from collections.abc import Awaitable, Mapping
from typing import Final, Protocol

from fastapi import Request
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from skyway.contracts.problem_details import ProblemDetails
from skyway.errors import SkywayError
from skyway.runtime.errors import TooLarge
from skyway.runtime.http.loop_time import charged
from skyway.runtime.http.problems import (
    our_failure,
    problem_headers,
    problem_of,
    problem_response,
    status_problem,
)
from skyway.runtime.http.service_router import body_limit_of
from skyway.runtime.metrics import count, observe
from skyway.runtime.tracing import tracing

log = logging.getLogger(__name__)

#: So many bytes of a refused body are read: a client that is cut off while it sends gets no answer.
_DRAINED_BYTES: Final = 8 * 1024 * 1024
_DRAIN_S: Final = 2.0

#: Statuses that count as refused. Keys and budgets have counts of their own (401, 429), and honest
#: callers meet conflicts (409, 410, 412).
_REFUSED: Final = frozenset({400, 403, 404, 405, 413, 415, 422})

_METHODS: Final = frozenset({"GET", "POST", "PUT", "PATCH", "DELETE", "HEAD", "OPTIONS"})


class Admission(Protocol):
    """Checks each request before its body is read."""

    async def __call__(self, request: Request) -> Mapping[str, str]:
        """Headers for the answer; a `SkywayError` refuses the request."""
        ...


#: Answers belong to one caller, and some hold secrets: no cache stores them, and no browser guesses
#: their type.
_DEFAULT_HEADERS: Final = (
    (b"cache-control", b"no-store"),
    (b"x-content-type-options", b"nosniff"),
)

#: Path parameters that are secrets, such as the token of a tracking page.
_SECRET_PARAMETERS: Final = frozenset({"token"})

#: Services behind the gateway must see the same path that was checked here.
_ENCODED_SLASHES: Final = (b"%2f", b"%5c")


async def admit_all(request: Request) -> Mapping[str, str]:
    """The entrance of an app without keys."""
    del request
    return {}


class RequestBoundary:
    """ASGI middleware: the trace, the entrance, the limit of the body, uncaught errors."""

    def __init__(self, app: ASGIApp, entrance: Admission = admit_all) -> None:
        self._app = app
        self._entrance = entrance

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        is_head = scope["method"] == "HEAD"
        # A HEAD is answered like a GET: the server still knows which of them came.
        request = Request({**scope, "method": "GET"} if is_head else scope)
        started_at = time.monotonic()
        with tracing(request.headers.get("traceparent"), lambda: _span_name(request)):
            exchange = _Exchange(request, receive, _without_body(send) if is_head else send)
            await self._serve(request, exchange)
        if exchange.status in _REFUSED and hasattr(request.state, "note_refusal"):
            request.state.note_refusal()
        _count_request(request, exchange, started_at)

    async def _serve(self, request: Request, exchange: "_Exchange") -> None:
        if (fault := _fault_of_url(request.scope)) is not None:
            await exchange.answer(status_problem(400, fault))
            return
        try:
            exchange.headers = await self._entrance(request=request)
        except SkywayError as refusal:
            await exchange.answer(problem_of(refusal), problem_headers(refusal))
            return
        serving = self._app(request.scope, exchange.receive, exchange.send)
        try:
            await charged(request.scope, _awaited(serving))
        except ClientDisconnect:
            log.info("client left", extra={"path": _logged_path(request)})
        except Exception:  # noqa: BLE001 - the outermost frame of a request: log and answer
            await _answer_uncaught(request, exchange)


class _Exchange:
    """One request and its answer, with the body counted as it comes in."""

    def __init__(self, request: Request, receive: Receive, send: Send) -> None:
        self.status = 0
        #: When the answer began, by `time.monotonic`.
        self.answered_at: float | None = None
        #: Added to every answer.
        self.headers: Mapping[str, str] = {}
        self._request = request
        self._receive = receive
        self._send = send
        self._received_bytes = 0
        self._is_body_complete = False
        #: The limit of the route, once the body is read.
        self._limit_bytes: int | None = None
        self._is_too_large = False

    async def receive(self) -> Message:
        """The next part of the body, unless it goes over the limit of the route."""
        if self._limit_bytes is None:
            self._limit_bytes = body_limit_of(self._request)
            self._refuse_larger(_announced_bytes(self._request), self._limit_bytes)
        message = await self._receive()
        if message["type"] == "http.request":
            self._received_bytes += len(message.get("body", b""))
            self._charge(message)
            self._is_body_complete = not message.get("more_body", False)
            self._refuse_larger(self._received_bytes, self._limit_bytes)
        return message

    def _refuse_larger(self, size_bytes: int, limit_bytes: int) -> None:
        # A stream that has begun waits here for the end of its reader.
        if self.status == 0 and size_bytes > limit_bytes:
            self._is_too_large = True
            raise TooLarge(limit_bytes)

    async def send(self, message: Message) -> None:
        """Pass the answer on. If the body is too large, the answer is always 413."""
        if self.status == 0 and self._is_too_large:
            await self._refuse_body()
        elif not self._is_too_large:
            if self.status == 0:
                self.status = message["status"]
                self.answered_at = time.monotonic()
                given = message.get("headers", [])
                names = {name.lower() for name, _ in given}
                defaults = [each for each in _DEFAULT_HEADERS if each[0] not in names]
                message["headers"] = [*given, *defaults, *_encoded(self.headers)]
            self._charge(message)
            await self._send(message)

    def _charge(self, message: Message) -> None:
        if (account := getattr(self._request.state, "account", None)) is not None:
            account.add_bytes(len(message.get("body", b"")))

    async def _refuse_body(self) -> None:
        """Answer 413, after reading what the client is still sending."""
        # A client that sent Expect still waits with its body; reading would ask for the body.
        if "expect" not in self._request.headers:
            await self._drain()
        await self.answer(problem_of(TooLarge(self._limit_bytes or 0)))

    async def answer(
        self, problem: ProblemDetails, headers: Mapping[str, str] | None = None
    ) -> None:
        """Answer with a problem document."""
        self.status = problem.status
        self.answered_at = time.monotonic()
        response = problem_response(problem, {**self.headers, **(headers or {})})
        response.headers.update({name.decode(): value.decode() for name, value in _DEFAULT_HEADERS})
        await response(self._request.scope, self._receive, self._send)

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


def _without_body(send: Send) -> Send:
    """Sends only the head of an answer, and ends it; a stream sees that its client has left."""

    async def send_head(message: Message) -> None:
        if message["type"] == "http.response.start":
            await send(message)
            await send({"type": "http.response.body", "body": b""})

    return send_head


async def _awaited(serving: Awaitable[None]) -> None:
    await serving


async def _answer_uncaught(request: Request, exchange: _Exchange) -> None:
    place = {"method": request.method, "path": _logged_path(request)}
    log.exception("request failed", extra=place)
    if exchange.status == 0:
        await exchange.answer(our_failure())


def _fault_of_url(scope: Scope) -> str | None:
    """Why a path or query is refused before it is used; None if it is fine."""
    if "\0" in scope["path"] or b"%00" in scope["query_string"]:
        return "the path and the query may not hold U+0000"
    raw_path = scope.get("raw_path", b"").lower()
    if any(slash in raw_path for slash in _ENCODED_SLASHES):
        return "the path may not hold an encoded slash"
    return None


def _encoded(headers: Mapping[str, str]) -> list[tuple[bytes, bytes]]:
    return [(name.lower().encode(), value.encode()) for name, value in headers.items()]


def _announced_bytes(request: Request) -> int:
    announced = request.headers.get("content-length", "0")
    return int(announced) if announced.isdecimal() else 0


def _logged_path(request: Request) -> str:
    """The path for the log, without the secrets in it; of an unknown path only how it begins."""
    route = getattr(request.scope.get("route"), "path", None)
    if route is None:
        first = request.scope["path"].split("/")[1:2]
        return "/".join(["", *first, "..."])
    shown = request.scope.get("path_params", {})
    for name in shown.keys() - _SECRET_PARAMETERS:
        route = route.replace(f"{{{name}}}", str(shown[name]))
    return str(route)


def _span_name(request: Request) -> str:
    route = getattr(request.scope.get("route"), "path", "")
    method = request.method if request.method in _METHODS else "OTHER"
    return f"{method} {route}".rstrip()


def _count_request(request: Request, exchange: _Exchange, started_at: float) -> None:
    route = getattr(request.scope.get("route"), "path", "")
    # The client chooses the method: counting unknown methods could make any number of series.
    method = request.method if request.method in _METHODS else "OTHER"
    code, elapsed_s = str(exchange.status), time.monotonic() - started_at
    count("skyway_http_requests", "requests", method=method, route=route, status=code)
    name, about = "skyway_http_request_seconds", "time spent on requests"
    count(name, about, elapsed_s, method=method, route=route, status=code)
    if exchange.answered_at is not None:  # else its client left before
        observe(
            "skyway_http_request_duration_seconds",
            "time from a request to the beginning of its answer",
            exchange.answered_at - started_at,
            method=method,
            route=route,
            status=f"{code[0]}xx",
        )
