"""Waiting until a local system is ready."""

import asyncio
import json
import socket
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager

import pytest

from skyway.cli.system.readiness import until_ready

#: The answer of a service that hangs up without a word.
SILENT = "(silent)"

#: The answer of a service that is ready without a connection to the broker.
NO_BROKER = "(no broker)"


@pytest.fixture
def broker(monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """The socket of a broker that SKYWAY_MQTT_URL names; it listens after `listen` was called."""
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        monkeypatch.setenv("SKYWAY_MQTT_URL", f"mqtt://127.0.0.1:{bound.getsockname()[1]}")
        yield bound


@asynccontextmanager
async def a_gateway(answers: list[str | None]) -> AsyncIterator[str]:
    """A service that says at each look what it lacks, the last answer for ever; its address."""

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        lack = answers.pop(0) if len(answers) > 1 else answers[0]
        if lack == SILENT:
            writer.close()
            return
        status = "200 OK" if lack in (None, NO_BROKER) else "503 Service Unavailable"
        body = json.dumps({"detail": lack, "checks": {"mqtt": lack != NO_BROKER}})
        head = f"HTTP/1.1 {status}\r\nContent-Length: {len(body)}\r\nConnection: close\r\n\r\n"
        writer.write((head + body).encode())
        await writer.drain()
        writer.close()

    async with await asyncio.start_server(answer, "127.0.0.1", 0) as server:
        yield f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}"


async def said_first(url: str, *, about: str = "") -> str:
    """What is said first, of a service that is never ready, and has this in it."""
    said: asyncio.Queue[str] = asyncio.Queue()
    waiting = asyncio.ensure_future(
        until_ready({"gateway": url}, say=said.put_nowait, long_s=0.0, long_to_start_s=0.0)
    )
    try:
        async with asyncio.timeout(60):
            while about not in (words := await said.get()):
                pass
            return words
    finally:
        waiting.cancel()


async def test_the_reason_of_a_long_wait_is_printed_once() -> None:
    said: list[str] = []

    async with a_gateway(["no planner", "no planner", "no planner", None]) as url:
        await until_ready({"gateway": url}, say=said.append, long_s=0.0)

    assert said == ["Still waiting: no planner."]


async def test_a_short_wait_prints_nothing() -> None:
    said: list[str] = []

    async with a_gateway(["no planner", None]) as url:
        await until_ready({"gateway": url}, say=said.append, long_s=60.0)

    assert said == []


async def test_a_service_that_is_starting_is_given_more_time() -> None:
    said: list[str] = []

    async with a_gateway([SILENT, "no planner", None]) as url:
        await until_ready({"gateway": url}, say=said.append, long_s=0.0)

    assert said == ["Still waiting: no planner."]


async def test_a_start_that_goes_on_says_again_what_is_not_ready() -> None:
    said: list[str] = []

    async with a_gateway([SILENT, SILENT, None]) as url:
        await until_ready({"gateway": url}, say=said.append, goes_on_every_s=0.0)

    assert said == ["Starting for 0 s; not ready yet: gateway."] * 2


async def test_a_service_that_never_answers_is_named() -> None:
    async with a_gateway([SILENT]) as url:
        assert await said_first(url) == "Still waiting: gateway does not answer yet."


async def test_a_service_without_its_broker_is_waited_for() -> None:
    said: list[str] = []

    async with a_gateway([NO_BROKER, None]) as url:
        await until_ready({"gateway": url}, say=said.append, long_s=0.0)

    assert said == ["Still waiting: gateway has no connection to: mqtt."]


async def test_a_broker_that_is_not_running_is_named_with_advice(
    broker: socket.socket,
) -> None:
    async with a_gateway(["missing: mqtt"]) as url:
        words = await said_first(url, about="broker")

    assert f"127.0.0.1:{broker.getsockname()[1]}, is not running" in words
    assert "unset SKYWAY_MQTT_URL" in words


async def test_a_broker_that_refuses_the_services_is_named_as_such(
    broker: socket.socket,
) -> None:
    broker.listen()

    async with a_gateway(["missing: mqtt"]) as url:
        assert "does not let them in" in await said_first(url, about="broker")
