"""How one service calls another: typed calls, and whole requests that are passed on."""

import copy
import logging
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from http import HTTPStatus
from typing import Any, Final, Self, TypedDict, TypeVar, Unpack, overload
from urllib.parse import quote, urlencode

import aiohttp
import httpx
from fastapi import Request
from fastapi.responses import StreamingResponse
from httpx_aiohttp import AiohttpTransport
from pydantic import TypeAdapter, ValidationError

from skyway.contracts.problem_details import ProblemDetails
from skyway.json_model import JsonModel
from skyway.runtime.errors import NotFound, RemoteProblem, ServiceUnavailable
from skyway.runtime.http.identity import Caller, ServiceIdentity
from skyway.runtime.tracing import current_traceparent

log = logging.getLogger(__name__)

T = TypeVar("T")

#: Longest time to open a connection, wall seconds; and the most connections to one service.
_CONNECT_S: Final = 2.0
_MOST_CONNECTIONS: Final = 100
#: Servers close a connection after 5 s of silence. A request must not meet that.
_KEEPALIVE_S: Final = 4.0
#: How long a service may take to answer. A forwarded body may be large and take longer.
_ANSWER_S: Final = 10.0
_FORWARD_S: Final = 30.0
_PATH_SAFE: Final = "/%:@"
_FORWARDED_HEADERS: Final = (
    "accept",
    "content-encoding",
    "content-length",
    "content-type",
    "idempotency-key",
    "if-match",
    "if-none-match",
    "last-event-id",
)
_RETURNED_HEADERS: Final = (
    "allow",
    "cache-control",
    "content-length",
    "content-type",
    "etag",
    "last-modified",
    "link",
    "location",
    "retry-after",
)


class CallOptions(TypedDict, total=False):
    """The options of a call; `query` and `headers` are added to our own."""

    body: JsonModel | bytes  # bytes are JSON already
    caller: Caller | None
    timeout_s: float
    query: Mapping[str, str]
    headers: Mapping[str, str]


class ServiceClient:
    """A client of one other service. Its pool of connections lives as long as the block.

    GET, PUT and DELETE are sent again when the service has closed the connection meanwhile.

    Parameters
    ----------
    name
        Of the called service, for errors and logs.
    identity
        Of the calling service.
    transport
        Another way to the service than TCP: httpx's ASGI transport in tests.

    Notes
    -----
    Requests go to httpx's transport directly: `httpx.AsyncClient` would add cookies, redirects,
    proxies of the environment and headers that no service needs.
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
        self.url = base_url.rstrip("/")
        self._transport = transport
        self._opened: httpx.AsyncBaseTransport | None = None
        self._added: Mapping[str, str] = {}

    def at(self, url: str, *, name: str) -> "ServiceClient":
        """A client of the same service at another address, with connections of its own."""
        return ServiceClient(name, url, self._identity, transport=self._transport)

    def adding(self, headers: Mapping[str, str]) -> Self:
        """The same connections; these headers are added to each request."""
        copied = copy.copy(self)
        copied._added = headers
        return copied

    async def __aenter__(self) -> Self:
        """Open the pool; nothing is connected yet."""
        self._opened = self._transport or AiohttpTransport(client=_new_pool, trust_env=False)
        return self

    async def __aexit__(self, *_: object) -> None:
        """Close all connections."""
        if self._opened is not None:
            await self._opened.aclose()
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
        """The service's answer as a value of type `answer`; None if no type is given.

        Raises
        ------
        RemoteProblem
            It answered 4xx, with a problem document.
        ServiceUnavailable
            It cannot be reached, answered 5xx, 401 or 421, or not in time.
        """
        body = options.get("body")
        headers = {**self._headers(options.get("caller")), **options.get("headers", {})}
        if body is not None:
            headers["content-type"] = "application/json"
        query = options.get("query")
        request = httpx.Request(
            method,
            self.url + path + (f"?{urlencode(query)}" if query else ""),
            headers=headers,
            content=body.model_dump_json().encode() if isinstance(body, JsonModel) else body,
            extensions={"timeout": _timeout(options.get("timeout_s", _ANSWER_S))},
        )
        with self._connections() as connections:
            response = await connections.handle_async_request(request)
            try:
                content = await response.aread()
            finally:
                await response.aclose()
        self._refuse_failure(response)
        return None if answer is None else self._parse(answer, content)

    async def forward(
        self, request: Request, path: str, caller: Caller | None, *, timeout_s: float = _FORWARD_S
    ) -> StreamingResponse:
        """The service's own answer to a whole request; both bodies are streamed, never held.

        The query is passed on, and of the headers only those that services understand.

        Raises
        ------
        ServiceUnavailable
            It cannot be reached, refuses our secret, or does not answer in time.
        """
        if any(part in {".", ".."} for part in path.split("/")):
            raise NotFound("path", path)
        has_body = {"content-length", "transfer-encoding"} & set(request.headers)
        passed = {n: request.headers[n] for n in _FORWARDED_HEADERS if n in request.headers}
        url = self.url + quote(path, safe=_PATH_SAFE)
        outgoing = httpx.Request(
            request.method,
            httpx.URL(url, query=request.url.query.encode() or None),
            content=request.stream() if has_body else None,
            # Headers are passed on as they came: they may hold any byte above 127.
            headers=httpx.Headers(
                {"accept-encoding": "identity", **passed, **self._headers(caller)},
                encoding="latin-1",
            ),
            extensions={"timeout": _timeout(timeout_s)},
        )
        with self._connections() as connections:
            response = await connections.handle_async_request(outgoing)
        if response.status_code in (HTTPStatus.UNAUTHORIZED, HTTPStatus.MISDIRECTED_REQUEST):
            await response.aclose()
            self._refuse_failure(response)
        return StreamingResponse(
            _stream(response),
            status_code=response.status_code,
            headers={n: response.headers[n] for n in _RETURNED_HEADERS if n in response.headers},
        )

    def _headers(self, caller: Caller | None) -> dict[str, str]:
        traceparent = current_traceparent()
        trace = {} if traceparent is None else {"traceparent": traceparent}
        return {**self._identity.headers(caller), **trace, **self._added}

    @contextmanager
    def _connections(self) -> Iterator[httpx.AsyncBaseTransport]:
        """Raise ServiceUnavailable if a connection to the service fails within the block."""
        if self._opened is None:
            raise ServiceUnavailable(self.name, "its client is not open")
        try:
            yield self._opened
        except httpx.ConnectTimeout as error:  # the transport reports lost connections so
            raise ServiceUnavailable(self.name, "it cannot be reached") from error
        except httpx.TimeoutException as error:
            raise ServiceUnavailable(self.name, "it did not answer in time") from error
        # aiohttp's errors are those for which the transport has no translation.
        except (httpx.TransportError, aiohttp.ClientError) as error:
            raise ServiceUnavailable(self.name, "it cannot be reached") from error

    def _refuse_failure(self, response: httpx.Response) -> None:
        """Raise what an answer other than 2xx means.

        Raises
        ------
        RemoteProblem
            The service refuses: the same request would be refused again.
        ServiceUnavailable
            It failed, refuses our secret, or does not serve this: a later call may succeed.
        """
        if response.status_code == HTTPStatus.UNAUTHORIZED:
            raise self._secret_refused()
        if response.status_code == HTTPStatus.MISDIRECTED_REQUEST:
            raise ServiceUnavailable(self.name, "another server serves this now")
        if response.is_server_error:
            raise ServiceUnavailable(self.name, f"it answered {response.status_code}")
        if not response.is_success:
            raise RemoteProblem(response.status_code, _problem_in(response))

    def _secret_refused(self) -> ServiceUnavailable:
        """A 401 between services is not the caller's fault, so the caller gets a 503."""
        log.error("secret refused", extra={"asked_service": self.name})
        return ServiceUnavailable(self.name, "it does not accept the secret shown to it")

    def _parse(self, answer: type[T], content: bytes) -> T:
        """The value in an answer; fields that this version does not know are ignored."""
        reader: TypeAdapter[T] = _type_adapter(answer)  # type: ignore[arg-type]  # it is hashable
        try:
            return reader.validate_json(content, extra="ignore")
        except ValidationError as error:
            log.exception("answer unreadable", extra={"asked_service": self.name})
            raise ServiceUnavailable(self.name, "its answer cannot be read") from error


def _new_pool() -> aiohttp.ClientSession:
    """The connections of the transport, without cookies and without headers of their own."""
    return aiohttp.ClientSession(
        connector=aiohttp.TCPConnector(limit=_MOST_CONNECTIONS, keepalive_timeout=_KEEPALIVE_S),
        cookie_jar=aiohttp.DummyCookieJar(),
        skip_auto_headers=("Accept", "Accept-Encoding", "User-Agent"),
    )


@lru_cache(maxsize=16)  # calls use few different times
def _timeout(timeout_s: float) -> dict[str, float | None]:
    return httpx.Timeout(timeout_s, connect=_CONNECT_S).as_dict()


@lru_cache(maxsize=256)  # making one takes as long as reading a small answer
def _type_adapter(answer: type[Any]) -> TypeAdapter[Any]:
    """Any: the type that the caller expects."""
    return TypeAdapter(answer)


def _problem_in(response: httpx.Response) -> dict[str, Any]:  # problems have members of their own
    try:
        problem = ProblemDetails.model_validate_json(response.content)
    except ValidationError:
        problem = ProblemDetails(title=response.reason_phrase, status=response.status_code)
    return problem.model_dump(mode="json", exclude_none=True)


async def _stream(response: httpx.Response) -> AsyncIterator[bytes]:
    try:
        async for part in response.aiter_raw():
            yield part
    finally:
        await response.aclose()
