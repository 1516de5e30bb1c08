"""A wire between two processes: it carries, breaks, holds back and slows."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest
from skyway_lab.benchmarks.chaos.wire import Wire


@asynccontextmanager
async def echoing() -> AsyncIterator[tuple[str, int]]:
    """A server that sends everything back."""

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while data := await reader.read(1_000):
                writer.write(data)
                await writer.drain()
        await end(writer)

    server = await asyncio.start_server(answer, "127.0.0.1", 0)
    async with server:
        yield ("127.0.0.1", server.sockets[0].getsockname()[1])


@pytest.fixture
async def wire() -> AsyncIterator[Wire]:
    async with echoing() as address, Wire("echo", address) as wire:
        yield wire


async def end(writer: asyncio.StreamWriter) -> None:
    writer.close()
    with suppress(OSError):
        await writer.wait_closed()


async def said_over(wire: Wire, words: bytes = b"hello") -> bytes:
    reader, writer = await asyncio.open_connection("127.0.0.1", wire.port)
    writer.write(words)
    answer = await reader.read(len(words))
    await end(writer)
    return answer


async def test_it_carries_data_in_both_directions(wire: Wire) -> None:
    assert await said_over(wire) == b"hello"


async def test_a_cut_wire_breaks_its_connections_and_refuses_new_ones(wire: Wire) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", wire.port)
    writer.write(b"hello")
    assert await reader.read(5) == b"hello"

    wire.cut()

    assert await _what_comes(reader) == b""
    assert await _answer_to_new(wire) == b""
    await end(writer)


async def _answer_to_new(wire: Wire) -> bytes:
    reader, writer = await asyncio.open_connection("127.0.0.1", wire.port)
    answer = await _what_comes(reader)
    await end(writer)
    return answer


async def _what_comes(reader: asyncio.StreamReader) -> bytes:
    """What arrives until the end; nothing when the connection is reset."""
    try:
        return await reader.read(100)
    except ConnectionResetError:
        return b""


async def test_a_healed_wire_carries_new_connections(wire: Wire) -> None:
    wire.cut()
    wire.heal()

    assert await said_over(wire) == b"hello"


async def test_a_silent_wire_holds_data_back_until_it_heals(wire: Wire) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", wire.port)
    writer.write(b"1")
    assert await reader.read(1) == b"1"

    wire.silence()
    writer.write(b"2")
    coming = asyncio.create_task(reader.read(1))
    done, _ = await asyncio.wait({coming}, timeout=0.05)
    wire.heal()

    assert not done
    assert await coming == b"2"
    await end(writer)


async def test_a_slow_wire_delays_data(wire: Wire) -> None:
    loop = asyncio.get_running_loop()
    wire.slow(0.05)
    started_s = loop.time()

    answer = await said_over(wire)

    assert answer == b"hello"
    assert loop.time() - started_s >= 0.1


async def test_it_can_listen_at_a_socket_in_the_file_system(tmp_path: Path) -> None:
    path = tmp_path / "socket"
    async with echoing() as address, Wire("echo", address, listens_at=path) as wire:
        reader, writer = await asyncio.open_unix_connection(path)
        writer.write(b"hello")
        answer = await reader.read(5)
        await end(writer)

    assert answer == b"hello"
    assert wire.folder == tmp_path
