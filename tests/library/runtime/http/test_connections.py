"""Calls over kept connections to a service that may close, stall, refuse early, or be away."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from skyway.json_model import JsonModel
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import ServiceIdentity


class Parcel(JsonModel):
    name: str


PARCEL = Parcel(name="a")

Answer = Callable[[bytes, asyncio.StreamWriter], Awaitable[None]]


@dataclass
class Server:
    """Hands each request's head and body to `answer`, and counts connections."""

    answer: Answer
    connections: int = 0
    received: list[bytes] = field(default_factory=list)
    url: str = ""

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.connections += 1
        try:
            while head := await _head(reader):
                self.received.append(head + await _body(reader, head))
                await self.answer(self.received[-1], writer)
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
    writer.write(b'HTTP/1.1 200 OK\r\ncontent-length: 12\r\n\r\n{"name":"b"}')


async def say_nothing(_request: bytes, _writer: asyncio.StreamWriter) -> None:
    return


async def hang_up(_request: bytes, writer: asyncio.StreamWriter) -> None:
    writer.close()


@pytest.fixture
def identity(tmp_path: Path) -> ServiceIdentity:
    (tmp_path / "service_gateway").write_text("for-the-gateway")
    return ServiceIdentity("gateway", tmp_path)


@asynccontextmanager
async def serving(
    identity: ServiceIdentity, answer: Answer = say_ok
) -> AsyncIterator[tuple[Server, ServiceClient]]:
    server = Server(answer)
    listener = await asyncio.start_server(server.serve, "127.0.0.1", 0)
    server.url = f"http://127.0.0.1:{listener.sockets[0].getsockname()[1]}"
    async with ServiceClient("registry", server.url, identity) as client:
        yield server, client
    listener.close()
    await listener.wait_closed()


async def test_calls_after_one_another_share_a_connection(identity: ServiceIdentity) -> None:
    async with serving(identity) as (server, client):
        answers = [await client.call("POST", "/x", body=PARCEL, answer=Parcel) for _ in range(3)]

        assert answers == [Parcel(name="b")] * 3
        assert server.connections == 1
        assert all(received.endswith(b'{"name":"a"}') for received in server.received)


async def test_a_call_carries_only_our_own_headers(identity: ServiceIdentity) -> None:
    async with serving(identity) as (server, client):
        await client.call("POST", "/x", body=PARCEL, query={"a": "b c"})

    request_line, *headers = server.received[0].partition(b"\r\n\r\n")[0].decode().split("\r\n")
    names = {header.partition(":")[0].lower() for header in headers}
    assert request_line == "POST /x?a=b+c HTTP/1.1"
    assert names == {"host", "authorization", "skyway-caller", "content-type", "content-length"}


async def test_a_cookie_is_not_kept(identity: ServiceIdentity) -> None:
    async def give_cookie(_request: bytes, writer: asyncio.StreamWriter) -> None:
        writer.write(b"HTTP/1.1 200 OK\r\nset-cookie: a=b\r\ncontent-length: 0\r\n\r\n")

    async with serving(identity, give_cookie) as (server, client):
        for _ in range(2):
            await client.call("GET", "/x")

    assert b"cookie" not in server.received[1].lower()


async def test_an_answer_that_breaks_off_is_unavailable(identity: ServiceIdentity) -> None:
    async def begin(_request: bytes, writer: asyncio.StreamWriter) -> None:
        writer.write(b'HTTP/1.1 200 OK\r\ncontent-length: 12\r\n\r\n{"nam')
        await writer.drain()
        writer.close()

    async with serving(identity, begin) as (_server, client):
        with pytest.raises(ServiceUnavailable, match="cannot be reached"):
            await client.call("GET", "/x", answer=Parcel)


async def test_calls_at_the_same_time_have_a_connection_each(identity: ServiceIdentity) -> None:
    async with serving(identity) as (server, client):
        await asyncio.gather(*(client.call("GET", "/x") for _ in range(5)))

        assert server.connections == 5


@pytest.mark.parametrize(
    ("method", "attempts"), [("GET", 2), ("PUT", 2), ("DELETE", 2), ("POST", 1), ("PATCH", 1)]
)
async def test_only_repeatable_methods_are_sent_again(
    identity: ServiceIdentity, method: str, attempts: int
) -> None:
    async with serving(identity, hang_up) as (server, client):
        with pytest.raises(ServiceUnavailable, match="cannot be reached"):
            await client.call(method, "/x", body=PARCEL)

        assert len(server.received) == attempts
        assert all(received.endswith(b'{"name":"a"}') for received in server.received)


async def test_a_restarted_service_is_called_again(
    identity: ServiceIdentity,
) -> None:
    async def ok_and_close(request: bytes, writer: asyncio.StreamWriter) -> None:
        await say_ok(request, writer)
        await writer.drain()
        writer.close()

    async with serving(identity, ok_and_close) as (server, client):
        answers = [await client.call("GET", "/x", answer=Parcel) for _ in range(3)]

        assert answers == [Parcel(name="b")] * 3
        assert server.connections >= 3


async def test_a_refusal_that_comes_before_the_whole_body_is_read(
    identity: ServiceIdentity,
) -> None:
    async def refuse(_request: bytes, writer: asyncio.StreamWriter) -> None:
        writer.write(b"HTTP/1.1 413 Too Large\r\ncontent-length: 0\r\nconnection: close\r\n\r\n")

    async with serving(identity, refuse) as (_server, client):
        with pytest.raises(RemoteProblem, match="413"):
            await client.call("POST", "/x", body=Parcel(name="a" * 1_000))


async def test_a_service_that_says_nothing_does_not_answer_in_time(
    identity: ServiceIdentity,
) -> None:
    async with serving(identity, say_nothing) as (_server, client):
        with pytest.raises(ServiceUnavailable, match="did not answer in time"):
            await client.call("GET", "/x", timeout_s=0.05)


async def test_a_service_that_is_not_there_cannot_be_reached(identity: ServiceIdentity) -> None:
    async with serving(identity) as (server, _client):
        url = server.url
    async with ServiceClient("registry", url, identity) as client:
        with pytest.raises(ServiceUnavailable, match="cannot be reached"):
            await client.call("GET", "/x")
