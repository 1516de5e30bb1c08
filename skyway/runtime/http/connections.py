"""Connections to another service: for a question and its whole answer, and for what is streamed.

Both share one pool, aiohttp's. Questions go to it directly: httpx, made for whoever talks to any
server, takes as much processor time again for objects that nobody here looks at.
"""

from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Final

import aiohttp
import httpx
from httpx_aiohttp import AiohttpTransport

from skyway.runtime.errors import ServiceUnavailable

#: Wall seconds that a new connection may take, and how many there are at once.
CONNECT_S: Final = 2.0
_MOST_CONNECTIONS: Final = 100
#: Servers close what was silent for 5 s; a request must not meet that.
_KEPT_S: Final = 4.0


@dataclass(frozen=True, slots=True)
class Question:
    """One request; `timeout_s` for a connection, and for each part of the answer."""

    method: str
    url: str
    headers: Mapping[str, str]
    content: bytes | None
    timeout_s: float


@dataclass(frozen=True, slots=True)
class Answer:
    """A whole answer."""

    status: int
    reason: str
    content: bytes


@dataclass(frozen=True, slots=True)
class Connections:
    """What is open to a service: `ask` for whole answers, `streaming` for bodies in parts."""

    ask: Callable[[Question], Awaitable[Answer]]
    streaming: httpx.AsyncClient


@asynccontextmanager
async def open_connections(
    base_url: str, transport: httpx.AsyncBaseTransport | None
) -> AsyncIterator[Connections]:
    """A pool for as long as the block, or another `transport`; nothing is connected yet."""
    if transport is not None:
        async with _streaming(base_url, transport) as client:
            yield Connections(partial(_ask_over, transport), client)
        return
    async with _pool() as pool:
        over_pool = AiohttpTransport(client=pool, trust_env=False)
        async with _streaming(base_url, over_pool) as client:
            yield Connections(partial(_ask, pool), client)


@contextmanager
def unavailable_when_lost(service: str) -> Iterator[None]:
    """Say that a service is unavailable when a connection to it fails within the block."""
    try:
        yield
    except httpx.ConnectTimeout as error:  # what aiohttp's lost connections are to httpx
        raise ServiceUnavailable(service, "it cannot be reached") from error
    except (aiohttp.SocketTimeoutError, httpx.TimeoutException) as error:
        raise ServiceUnavailable(service, "it did not answer in time") from error
    except (aiohttp.ClientError, httpx.TransportError) as error:
        raise ServiceUnavailable(service, "it cannot be reached") from error


def _pool() -> aiohttp.ClientSession:
    """Connections that ask GET, PUT and DELETE again when one was closed by a restarted service.

    They take no proxy and no .netrc of the environment: this is between our own processes.
    """
    return aiohttp.ClientSession(
        connector=aiohttp.TCPConnector(limit=_MOST_CONNECTIONS, keepalive_timeout=_KEPT_S),
        cookie_jar=aiohttp.DummyCookieJar(),
        skip_auto_headers=("Accept", "Accept-Encoding", "User-Agent"),
    )


def _streaming(base_url: str, transport: httpx.AsyncBaseTransport) -> httpx.AsyncClient:
    return httpx.AsyncClient(base_url=base_url, transport=transport, trust_env=False)


async def _ask(pool: aiohttp.ClientSession, question: Question) -> Answer:
    asking = pool.request(
        question.method,
        question.url,
        data=question.content,
        headers=question.headers,
        allow_redirects=False,
        timeout=_timeout(question.timeout_s),
    )
    async with asking as response:
        return Answer(response.status, response.reason or "", await response.read())


@lru_cache(maxsize=16)  # calls name few
def _timeout(timeout_s: float) -> aiohttp.ClientTimeout:
    return aiohttp.ClientTimeout(connect=timeout_s, sock_connect=CONNECT_S, sock_read=timeout_s)


async def _ask_over(transport: httpx.AsyncBaseTransport, question: Question) -> Answer:
    timeout = httpx.Timeout(question.timeout_s, connect=CONNECT_S)
    request = httpx.Request(
        question.method,
        question.url,
        content=question.content,
        headers=question.headers,
        extensions={"timeout": timeout.as_dict()},
    )
    response = await transport.handle_async_request(request)
    try:
        return Answer(response.status_code, response.reason_phrase, await response.aread())
    finally:
        await response.aclose()
