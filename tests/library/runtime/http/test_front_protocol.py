"""Requests that are too large, too slow or too many, sent to a server on loopback."""

import asyncio
import socket
from collections.abc import AsyncIterator
from dataclasses import dataclass, replace
from functools import partial

import pytest
import uvicorn
from starlette.types import ASGIApp, Receive, Scope, Send

from skyway.runtime.http.client_disconnect import CALLER_GONE
from skyway.runtime.http.front_limits import ConnectionTable, FrontLimits
from skyway.runtime.http.front_protocol import FrontProtocol

LIMITS = FrontLimits(
    connections=20,
    per_address=10,
    url_bytes=1_000,
    head_bytes=4_000,
    head_s=60.0,
    body_s=60.0,
    dropped_bytes=100_000,
)
OK = b"HTTP/1.1 200"

#: Whether the app learned that the caller of `/gone` had left.
gone: list[bool] = []
#: `/slow-end` ends its answer, of which all bytes are sent, when this is set.
may_end = asyncio.Event()


async def app(scope: Scope, receive: Receive, send: Send) -> None:
    """Answers how long the body was; `/early` does not read it, `/never` gives no answer.

    `/slow-end` ends late. `/large` answers with more than the buffers of a connection hold.
    """
    if scope["type"] != "http":
        return
    if scope["path"] == "/gone":
        is_gone = scope["extensions"][CALLER_GONE]["is_gone"]
        gone.append(is_gone())
        while not is_gone():  # noqa: ASYNC110 - of another process
            await asyncio.sleep(0)
        gone.append(is_gone())
        return
    size, has_more = 0, scope["path"] != "/early"
    while has_more:
        message = await receive()
        if message["type"] == "http.disconnect":
            return
        size += len(message.get("body", b""))
        has_more = message.get("more_body", False)
    if scope["path"] == "/never":
        await receive()
        return
    if scope["path"] == "/slow-end":
        headers = [(b"content-length", b"1")]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        await send({"type": "http.response.body", "body": b"a", "more_body": True})
        await may_end.wait()
        await send({"type": "http.response.body"})
        return
    body = b"a" * 30_000_000 if scope["path"] == "/large" else str(size).encode()
    headers = [(b"content-length", str(len(body)).encode())]
    await send({"type": "http.response.start", "status": 200, "headers": headers})
    await send({"type": "http.response.body", "body": body})


@dataclass
class Front:
    """A server with these limits."""

    limits: FrontLimits = LIMITS
    served: ASGIApp = app
    port: int = 0
    table: ConnectionTable | None = None

    async def connect(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        return await asyncio.open_connection("127.0.0.1", self.port)

    async def ask(self, *parts: bytes) -> bytes:
        """What the server sends to these bytes until it closes the connection."""
        reader, writer = await self.connect()
        try:
            for part in parts:
                writer.write(part)
                await writer.drain()
            return await reader.read()
        except ConnectionError:
            return b""
        finally:
            writer.close()

    async def start(self) -> uvicorn.Server:
        self.table = ConnectionTable(self.limits)
        protocol = partial(FrontProtocol, limits=self.limits, table=self.table)
        config = uvicorn.Config(
            self.served,
            http=protocol,  # type: ignore[arg-type]
            port=0,
            lifespan="off",
            ws="none",
            log_config=None,
            proxy_headers=False,
        )
        server = uvicorn.Server(config)
        config.load()
        server.lifespan = config.lifespan_class(config)
        await server.startup()
        self.port = server.servers[0].sockets[0].getsockname()[1]
        return server


@pytest.fixture
async def front() -> AsyncIterator[Front]:
    made = Front()
    server = await made.start()
    yield made
    await server.shutdown()


async def slow_front(**changes: float) -> tuple[Front, uvicorn.Server]:
    """A server that waits only so long."""
    made = Front(replace(LIMITS, **changes))  # type: ignore[arg-type]
    return made, await made.start()


def get(path: bytes = b"/", *lines: bytes) -> bytes:
    return b"\r\n".join((b"GET " + path + b" HTTP/1.1", b"Host: x", *lines, b"", b""))


CLOSE = b"Connection: close"


async def test_a_request_within_the_limits_is_answered(front: Front) -> None:
    assert (await front.ask(get(b"/", CLOSE))).startswith(OK)


@pytest.mark.parametrize(
    ("parts", "status"),
    [
        ((get(b"/" + b"a" * 1_000),), 414),
        ((b"GET /", b"a" * 500, b"a" * 600), 414),
        ((get(b"/", b"X: " + b"a" * 4_000),), 431),
        ((b"GET / HTTP/1.1\r\nX: ", *[b"a" * 3_000] * 300), 431),
        ((b"GET / HTTP/1.1\r\n", *[b"a" * 3_000] * 300), 431),
        ((get(b"/", *[b"X: y"] * 101),), 431),
        ((b"nonsense\r\n\r\n",), 400),
        ((b"POST / HTTP/1.1\r\nContent-Length: x\r\n\r\n",), 400),
    ],
)
async def test_a_head_above_a_limit_is_refused_before_it_is_whole(
    front: Front, parts: tuple[bytes, ...], status: int
) -> None:
    answer = await front.ask(*parts)

    head, _, body = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 %d" % status)
    assert b"connection: close" in head
    assert b'"type": "urn:skyway:problem:' in body


CHUNKED = b"POST / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n"


@pytest.mark.parametrize(
    "parts",
    [
        (b"1\r\na\r\n0\r\n", b"X: y\r\n" * 200),
        (b"1\r\na\r\n0\r\nX: ", *[b"y" * 3_000] * 300),
        (b"1;x=", *[b"y" * 3_000] * 300),
    ],
)
async def test_chunk_framing_is_limited(front: Front, parts: tuple[bytes, ...]) -> None:
    answer = await front.ask(CHUNKED, *parts)

    assert answer.startswith((b"HTTP/1.1 431", b"HTTP/1.1 400"))


async def test_a_large_body_in_small_chunks_is_taken(front: Front) -> None:
    head = CHUNKED.replace(b"\r\n\r\n", b"\r\n" + CLOSE + b"\r\n\r\n")

    answer = await front.ask(head, *[b"a\r\n0123456789\r\n" * 1_000] * 20, b"0\r\n\r\n")

    assert answer.startswith(OK)
    assert answer.endswith(b"200000")


async def test_a_body_behind_a_split_head_does_not_count_as_head(front: Front) -> None:
    head = b"POST / HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Length: 50000\r\n"

    answer = await front.ask(head, b"\r\n" + b"a" * 50_000)

    assert answer.endswith(b"50000")


async def test_a_request_before_the_answer_to_the_last_one_ends_the_connection(
    front: Front,
) -> None:
    together = await front.ask(get() * 1_000)
    assert together.count(OK) == 1

    reader, writer = await front.connect()
    writer.write(get(b"/never"))
    await writer.drain()
    writer.write(get())
    await writer.drain()
    writer.write_eof()
    one_by_one = await reader.read()
    writer.close()

    assert OK not in one_by_one


async def test_a_request_after_the_last_byte_of_an_answer_is_read(front: Front) -> None:
    may_end.clear()
    reader, writer = await front.connect()
    writer.write(get(b"/slow-end"))
    await reader.readuntil(b"\r\n\r\n")
    assert await reader.readexactly(1) == b"a"
    writer.write(get(b"/", CLOSE))
    for _ in range(20):  # the server, in the same loop, reads the request
        await asyncio.sleep(0)
    may_end.set()

    assert (await reader.read()).count(OK) == 1
    writer.close()


async def test_requests_after_one_another_share_a_connection(front: Front) -> None:
    reader, writer = await front.connect()
    for _ in range(50):
        writer.write(get())
        assert (await reader.readuntil(b"\r\n\r\n")).startswith(OK)
        assert await reader.readexactly(1) == b"0"
    writer.close()


async def test_a_body_that_goes_on_after_its_answer_is_cut_off(front: Front) -> None:
    head = b"POST /early HTTP/1.1\r\nHost: x\r\nContent-Length: 100000000\r\n\r\n"

    answer = await front.ask(head, *[b"a" * 50_000] * 100)

    assert answer.startswith(OK) or answer == b""
    assert front.table is not None
    assert front.table.open == 0


@pytest.mark.parametrize("sent", [b"", b"GET / HT", b"GET / HTTP/1.1\r\nX: "])
async def test_half_a_head_is_waited_for_only_so_long(sent: bytes) -> None:
    front, server = await slow_front(head_s=0.05)

    answer = await front.ask(sent)

    assert answer.startswith(b"HTTP/1.1 408")
    await server.shutdown()


async def test_half_a_body_is_waited_for_only_so_long() -> None:
    front, server = await slow_front(body_s=0.05)

    answer = await front.ask(b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\nabc")

    assert answer.startswith(b"HTTP/1.1 408")
    await server.shutdown()


async def test_an_answer_that_takes_long_is_waited_for() -> None:
    front, server = await slow_front(head_s=0.05, body_s=0.05)
    reader, writer = await front.connect()
    writer.write(get(b"/never"))
    late, other = await front.connect()
    other.write(b"GET")

    assert (await late.read()).startswith(b"HTTP/1.1 408")
    assert not reader.at_eof()
    writer.close()
    other.close()
    await server.shutdown()


async def test_a_caller_that_leaves_its_answer_unread_is_cut_off() -> None:
    front, server = await slow_front(unread_s=0.05)
    assert front.table is not None
    _, writer = await front.connect()
    writer.write(get(b"/large"))
    try:
        async with asyncio.timeout(60):
            while not front.table.open:  # noqa: ASYNC110 - of the server
                await asyncio.sleep(0)
            while front.table.open:  # noqa: ASYNC110 - of the server
                await asyncio.sleep(0)
    finally:
        writer.transport.abort()
        await server.shutdown()


async def test_silent_connections_make_room_for_a_new_one(front: Front) -> None:
    silent = [await front.connect() for _ in range(30)]

    assert (await front.ask(get(b"/", CLOSE))).startswith(OK)
    assert front.table is not None
    assert front.table.open <= LIMITS.per_address
    for _, writer in silent:
        writer.close()


@pytest.mark.skipif(not hasattr(socket, "TCP_INFO"), reason="only Linux says so without reading")
async def test_an_app_that_reads_nothing_can_see_that_its_caller_has_left(front: Front) -> None:
    gone.clear()
    _, writer = await front.connect()
    writer.write(b"POST /gone HTTP/1.1\r\nHost: x\r\nContent-Length: 900000\r\n\r\n")
    writer.write(b"a" * 500_000)
    while not gone:  # noqa: ASYNC110 - of the server
        await asyncio.sleep(0)
    writer.transport.abort()

    async with asyncio.timeout(60):
        while len(gone) < 2:  # noqa: ASYNC110 - of the server
            await asyncio.sleep(0)

    assert gone == [False, True]
