"""Requests over kept connections to a server that may close, stall or say no early."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import httpx
import pytest

from skyway.runtime.http_transport import HttpTransport

Answer = Callable[[bytes, asyncio.StreamWriter], Awaitable[None]]


@dataclass
class Server:
    """Hands each request's head and body to `answer`, and counts connections."""

    answer: Answer
    connections: int = 0
    heard: list[bytes] = field(default_factory=list)
    url: str = ""

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.connections += 1
        try:
            while head := await _head(reader):
                self.heard.append(head + await _body(reader, head))
                await self.answer(self.heard[-1], writer)
                await writer.drain()
        except (ConnectionError, asyncio.IncompleteReadError):
            pass
        finally:
            writer.close()


async def _head(reader: asyncio.StreamReader) -> bytes:
    try:
        return await reader.readuntil(b"\r\n\r\n")
    except asyncio.IncompleteReadError:
        return b""


async def _body(reader: asyncio.StreamReader, head: bytes) -> bytes:
    for line in head.lower().split(b"\r\n"):
        if line.startswith(b"content-length:"):
            return await reader.readexactly(int(line.partition(b":")[2]))
        if line.startswith(b"transfer-encoding:"):
            return await reader.readuntil(b"0\r\n\r\n")
    return b""


async def say_ok(_request: bytes, writer: asyncio.StreamWriter) -> None:
    writer.write(b"HTTP/1.1 200 OK\r\ncontent-length: 2\r\n\r\nok")


@asynccontextmanager
async def serving(answer: Answer = say_ok) -> AsyncIterator[tuple[Server, httpx.AsyncClient]]:
    server = Server(answer)
    listener = await asyncio.start_server(server.serve, "127.0.0.1", 0)
    server.url = f"http://127.0.0.1:{listener.sockets[0].getsockname()[1]}"
    async with httpx.AsyncClient(
        base_url=server.url, transport=HttpTransport(), timeout=5.0, trust_env=False
    ) as client:
        yield server, client
    listener.close()
    await listener.wait_closed()


async def test_requests_after_one_another_share_a_connection() -> None:
    async with serving() as (server, client):
        texts = [(await client.post("/x", content=b"body")).text for _ in range(3)]

        assert texts == ["ok"] * 3
        assert server.connections == 1
        assert all(heard.endswith(b"body") for heard in server.heard)


async def test_requests_at_the_same_time_have_a_connection_each() -> None:
    async with serving() as (server, client):
        answers = await asyncio.gather(*(client.get("/x") for _ in range(5)))

        assert [answer.text for answer in answers] == ["ok"] * 5
        assert server.connections == 5


async def test_a_streamed_body_arrives_in_parts() -> None:
    async def parts() -> AsyncIterator[bytes]:
        yield b"one,"
        yield b"two"

    async with serving() as (server, client):
        await client.put("/x", content=parts())

        assert b"4\r\none,\r\n" in server.heard[0]
        assert b"3\r\ntwo\r\n" in server.heard[0]


async def test_an_answer_can_be_streamed_and_left_unread() -> None:
    async def endless(_request: bytes, writer: asyncio.StreamWriter) -> None:
        writer.write(b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n3\r\nabc\r\n")

    async with serving(endless) as (server, client):
        async with client.stream("GET", "/x") as answer:
            first = await anext(answer.aiter_raw())
        async with client.stream("GET", "/x") as answer:
            second = await anext(answer.aiter_raw())

        assert (first, second) == (b"abc", b"abc")
        assert server.connections == 2  # the first was in the middle of an answer


async def test_a_connection_that_the_server_closed_is_not_used_again() -> None:
    async def ok_and_close(request: bytes, writer: asyncio.StreamWriter) -> None:
        await say_ok(request, writer)
        await writer.drain()
        writer.close()

    async with serving(ok_and_close) as (server, client):
        await client.get("/x")
        answer = await _again_once_closed(client)

        assert answer.text == "ok"
        assert server.connections >= 2


async def _again_once_closed(client: httpx.AsyncClient) -> httpx.Response:
    """The news of a close may be under way: then the request breaks, as it may with any client."""
    try:
        return await client.get("/x")
    except (httpx.RemoteProtocolError, httpx.ReadError):
        return await client.get("/x")


async def test_an_answer_that_comes_before_the_whole_body_is_read() -> None:
    async def refuse(_request: bytes, writer: asyncio.StreamWriter) -> None:
        writer.write(b"HTTP/1.1 413 Too Large\r\ncontent-length: 0\r\nconnection: close\r\n\r\n")

    async with serving(refuse) as (_server, client):
        answer = await client.post("/x", content=b"x" * 1_000)

        assert answer.status_code == 413


async def test_no_answer_in_time_is_a_read_timeout() -> None:
    async def say_nothing(_request: bytes, _writer: asyncio.StreamWriter) -> None:
        return

    async with serving(say_nothing) as (_server, client):
        with pytest.raises(httpx.ReadTimeout):
            await client.get("/x", timeout=0.05)


async def test_a_server_that_hangs_up_breaks_the_request() -> None:
    async def hang_up(_request: bytes, writer: asyncio.StreamWriter) -> None:
        writer.close()

    async with serving(hang_up) as (_server, client):
        with pytest.raises(httpx.TransportError):
            await client.get("/x")


async def test_nobody_there_is_a_connect_error() -> None:
    async with serving() as (server, _client):
        url = server.url
    async with httpx.AsyncClient(transport=HttpTransport(), trust_env=False) as client:
        with pytest.raises(httpx.ConnectError):
            await client.get(url)
