"""How one service asks another: typed calls, and whole requests passed on."""

from collections.abc import AsyncIterator, Mapping
from contextlib import AsyncExitStack
from types import TracebackType
from typing import Any, Final, Self, TypedDict, TypeVar, Unpack, overload
from urllib.parse import quote, urlencode

import httpx
from fastapi import Request, Response
from fastapi.responses import StreamingResponse

from skyway.json_model import JsonModel
from skyway.runtime.errors import NotFound, ServiceUnavailable
from skyway.runtime.http.answer import not_known, read_answer, refuse_failure
from skyway.runtime.http.connections import (
    CONNECT_S,
    Connections,
    Question,
    open_connections,
    unavailable_when_lost,
)
from skyway.runtime.http.identity import Caller, ServiceIdentity
from skyway.runtime.tracing import current_traceparent

T = TypeVar("T")

#: How long a service may take to answer; a forwarded body may be large, and be answered late.
ANSWER_S: Final = 10.0
FORWARD_S: Final = 30.0
_PATH_SAFE: Final = "/%:@"
_PASSED_TO: Final = (
    "accept",
    "content-length",
    "content-type",
    "idempotency-key",
    "if-match",
    "if-none-match",
    "last-event-id",
)
_PASSED_BACK: Final = (
    "allow",
    "cache-control",
    "content-length",
    "content-type",
    "etag",
    "last-modified",
    "location",
    "retry-after",
)


class CallOptions(TypedDict, total=False):
    """What a call may carry beside its path; `query` and `headers` are added to our own."""

    body: JsonModel | bytes  # bytes are JSON already
    caller: Caller | None
    timeout_s: float
    query: Mapping[str, str]
    headers: Mapping[str, str]


class ServiceClient:
    """One other service, asked over a pool of connections that lives as long as the block.

    Parameters
    ----------
    name
        Of the asked service, for errors and logs.
    identity
        Of the asking service.
    transport
        Another way to the service than TCP: httpx's ASGI transport in tests.
    """

    def __init__(
        self,
        name: str,
        base_url: str,
        identity: ServiceIdentity,
        *,
        transport: httpx.AsyncBaseTransport | None = None,
    ) -> None:
        self.name = name
        self._identity = identity
        self._base_url = base_url.rstrip("/")
        self._transport = transport
        self._opened: Connections | None = None
        self._stack = AsyncExitStack()

    async def __aenter__(self) -> Self:
        """Open the pool; nothing is connected yet."""
        opened = open_connections(self._base_url, self._transport)
        self._opened = await self._stack.enter_async_context(opened)
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close all connections."""
        await self._stack.aclose()
        self._opened = None

    @overload
    async def call(
        self, method: str, path: str, *, answer: type[T], **options: Unpack[CallOptions]
    ) -> T: ...
    @overload
    async def call(
        self, method: str, path: str, *, answer: None = None, **options: Unpack[CallOptions]
    ) -> None: ...
    async def call(
        self,
        method: str,
        path: str,
        *,
        answer: type[Any] | None = None,  # any type with a JSON form
        **options: Unpack[CallOptions],
    ) -> Any:
        """What the service answers, as a value of type `answer`; nothing when that is None.

        Raises
        ------
        RemoteProblem
            It answered 4xx, with a problem document.
        ServiceUnavailable
            It cannot be reached, answered 5xx or 401, or not in time: asking later may help.
        """
        body = options.get("body")
        headers = {**self._headers(options.get("caller")), **options.get("headers", {})}
        if body is not None:
            headers["content-type"] = "application/json"
        query = options.get("query")
        question = Question(
            method,
            self._base_url + path + (f"?{urlencode(query)}" if query else ""),
            headers=headers,
            content=body.model_dump_json().encode() if isinstance(body, JsonModel) else body,
            timeout_s=options.get("timeout_s", ANSWER_S),
        )
        connections = self._connections
        with unavailable_when_lost(self.name):
            response = await connections.ask(question)
        refuse_failure(self.name, response)
        return None if answer is None else read_answer(self.name, answer, response)

    async def forward(
        self, request: Request, path: str, caller: Caller | None, *, timeout_s: float = FORWARD_S
    ) -> Response:
        """The service's own answer to a whole request; both bodies are streamed, never held.

        The query is passed on, and of the headers those in the list below.

        Raises
        ------
        ServiceUnavailable
            It cannot be reached, does not know us, or does not answer in time.
        """
        if any(part in {".", ".."} for part in path.split("/")):
            raise NotFound("path", path)
        has_body = {"content-length", "transfer-encoding"} & set(request.headers)
        passed = {name: request.headers[name] for name in _PASSED_TO if name in request.headers}
        outgoing = self._connections.streaming.build_request(
            request.method,
            httpx.URL(quote(path, safe=_PATH_SAFE), query=request.url.query.encode() or None),
            content=request.stream() if has_body else None,
            # As they came: a header may hold any byte above 127.
            headers=httpx.Headers(
                {"accept-encoding": "identity", **passed, **self._headers(caller)},
                encoding="latin-1",
            ),
            timeout=httpx.Timeout(timeout_s, connect=CONNECT_S),
        )
        with unavailable_when_lost(self.name):
            response = await self._connections.streaming.send(outgoing, stream=True)
        if response.status_code == httpx.codes.UNAUTHORIZED:
            await response.aclose()
            raise not_known(self.name)
        return StreamingResponse(
            _stream(response),
            status_code=response.status_code,
            headers={n: response.headers[n] for n in _PASSED_BACK if n in response.headers},
        )

    @property
    def _connections(self) -> Connections:
        if self._opened is None:
            raise ServiceUnavailable(self.name, "its client is not open")
        return self._opened

    def _headers(self, caller: Caller | None) -> dict[str, str]:
        traceparent = current_traceparent()
        trace = {} if traceparent is None else {"traceparent": traceparent}
        return {**self._identity.headers(caller), **trace}


async def _stream(response: httpx.Response) -> AsyncIterator[bytes]:
    try:
        async for part in response.aiter_raw():
            yield part
    finally:
        await response.aclose()
