"""How one service asks another: typed calls, and whole requests passed on."""

from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import AsyncExitStack, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from types import TracebackType
from typing import Any, Final, Self, TypedDict, TypeVar, Unpack, overload
from urllib.parse import quote

import httpx
from fastapi import Request, Response
from fastapi.responses import StreamingResponse
from httpx_aiohttp import AiohttpTransport

from skyway.json_model import JsonModel
from skyway.runtime.errors import NotFound, ServiceUnavailable
from skyway.runtime.http_answer import not_known, read_answer, refuse_failure
from skyway.runtime.identity import Caller, ServiceIdentity
from skyway.runtime.tracing import current_traceparent

T = TypeVar("T")

_CONNECT_S: Final = 2.0
#: How long a service may take to answer; a forwarded body may be large, and be answered late.
ANSWER_S: Final = 10.0
FORWARD_S: Final = 30.0
_PATH_SAFE: Final = "/%:@"
#: Servers close what was silent for 5 s; a request must not meet that.
_LIMITS: Final = httpx.Limits(
    max_connections=100, max_keepalive_connections=20, keepalive_expiry=4.0
)
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
    "idempotency-replayed",
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
        self._opened: _Pool | None = None
        self._stack = AsyncExitStack()

    async def __aenter__(self) -> Self:
        """Open the pool; nothing is connected yet."""
        # aiohttp's connections take half the processor time of httpx's own. It asks GET, PUT and
        # DELETE again when a kept connection turns out to be closed by a restarted service.
        # No proxy and no .netrc of the environment: this is between our own processes.
        transport = self._transport or AiohttpTransport(limits=_LIMITS, trust_env=False)
        client = httpx.AsyncClient(base_url=self._base_url, transport=transport, trust_env=False)
        self._opened = _Pool(await self._stack.enter_async_context(client), transport)
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
        url = _url(self._base_url + path)
        if query := options.get("query"):
            url = url.copy_merge_params(query)
        timeout = httpx.Timeout(options.get("timeout_s", ANSWER_S), connect=_CONNECT_S)
        request = httpx.Request(
            method,
            url,
            content=body.model_dump_json() if isinstance(body, JsonModel) else body,
            headers=headers,
            extensions={"timeout": timeout.as_dict()},
        )
        response = await self._ask(request)
        refuse_failure(self.name, response)
        return None if answer is None else read_answer(self.name, answer, response)

    async def forward(
        self, request: Request, path: str, caller: Caller | None, *, timeout_s: float = FORWARD_S
    ) -> Response:
        """The service's own answer to a whole request; both bodies are streamed, never held.

        The query is passed on, and of the headers those that contracts.md names.

        Raises
        ------
        ServiceUnavailable
            It cannot be reached, does not know us, or does not answer in time.
        """
        if any(part in {".", ".."} for part in path.split("/")):
            raise NotFound("path", path)
        has_body = {"content-length", "transfer-encoding"} & set(request.headers)
        passed = {name: request.headers[name] for name in _PASSED_TO if name in request.headers}
        outgoing = self._pool.client.build_request(
            request.method,
            httpx.URL(quote(path, safe=_PATH_SAFE), query=request.url.query.encode() or None),
            content=request.stream() if has_body else None,
            # As they came: a header may hold any byte above 127.
            headers=httpx.Headers(
                {"accept-encoding": "identity", **passed, **self._headers(caller)},
                encoding="latin-1",
            ),
            timeout=httpx.Timeout(timeout_s, connect=_CONNECT_S),
        )
        response = await self._send(outgoing)
        if response.status_code == httpx.codes.UNAUTHORIZED:
            await response.aclose()
            raise not_known(self.name)
        return StreamingResponse(
            _stream(response),
            status_code=response.status_code,
            headers={n: response.headers[n] for n in _PASSED_BACK if n in response.headers},
        )

    @property
    def _pool(self) -> "_Pool":
        if self._opened is None:
            raise ServiceUnavailable(self.name, "its client is not open")
        return self._opened

    def _headers(self, caller: Caller | None) -> dict[str, str]:
        traceparent = current_traceparent()
        trace = {} if traceparent is None else {"traceparent": traceparent}
        return {**self._identity.headers(caller), **trace}

    async def _ask(self, request: httpx.Request) -> httpx.Response:
        """The whole answer, past all that httpx's client does for browsers: half of its time."""
        transport = self._pool.transport
        with self._in_our_words():
            response = await transport.handle_async_request(request)
            try:
                await response.aread()
            finally:
                await response.aclose()
        return response

    async def _send(self, request: httpx.Request) -> httpx.Response:
        """The beginning of an answer, whose body is still to come."""
        with self._in_our_words():
            return await self._pool.client.send(request, stream=True)

    @contextmanager
    def _in_our_words(self) -> Iterator[None]:
        try:
            yield
        except httpx.ConnectTimeout as error:  # what aiohttp's refused and lost connections are
            raise ServiceUnavailable(self.name, "it cannot be reached") from error
        except httpx.TimeoutException as error:
            raise ServiceUnavailable(self.name, "it did not answer in time") from error
        except httpx.TransportError as error:
            raise ServiceUnavailable(self.name, "it cannot be reached") from error


@dataclass(frozen=True, slots=True)
class _Pool:
    """Open connections: for whole requests passed on, and bare."""

    client: httpx.AsyncClient
    transport: httpx.AsyncBaseTransport


@lru_cache(maxsize=256)  # most paths are asked for again and again
def _url(text: str) -> httpx.URL:
    return httpx.URL(text)


async def _stream(response: httpx.Response) -> AsyncIterator[bytes]:
    try:
        async for part in response.aiter_raw():
            yield part
    finally:
        await response.aclose()
