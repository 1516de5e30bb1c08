"""Streams of server-sent events end when their readers leave, without remains."""

import asyncio
import gc
import weakref
from collections.abc import AsyncIterator
from contextlib import nullcontext
from typing import Any

import pytest
from starlette.types import Message

from skyway.runtime.http.event_stream import EventStreamAnswer
from skyway.runtime.http.loop_time import Account
from skyway.runtime.limits import Budget, Meter, Slots


class Reader:
    """Reads the first chunk of a stream, and leaves."""

    def __init__(self, *, stays: bool = False) -> None:
        self.stays = stays
        self.read: list[bytes] = []
        self.leaves = asyncio.Event()
        self.meter = Meter(Budget("TENANT_REQUESTS", 1.0, 1_000), now=lambda: 0.0)

    async def receive(self) -> Message:
        await self.leaves.wait()
        return {"type": "http.disconnect"}

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.body":
            self.read.append(message["body"])
            if not self.stays:
                self.leaves.set()

    async def open(self, frames: AsyncIterator[str], slots: Slots) -> None:
        scope: dict[str, Any] = {"type": "http", "state": {"account": Account(self.meter, "a")}}
        answer = EventStreamAnswer(nullcontext(frames), slots=slots, who="a")
        await answer(scope, self.receive, self.send)


class Source:
    """Where the frames come from."""

    async def frames(self) -> AsyncIterator[str]:
        yield "data: 1\n\n"
        await asyncio.Event().wait()


async def test_a_stream_ends_when_its_reader_leaves() -> None:
    slots, reader = Slots("STREAMS", 1), Reader()

    await reader.open(Source().frames(), slots)

    assert (reader.read, slots.used("a")) == ([b"data: 1\n\n"], 0)


async def test_a_stream_that_ends_by_itself_is_closed() -> None:
    async def frames() -> AsyncIterator[str]:
        yield "data: 1\n\n"

    reader = Reader(stays=True)

    await reader.open(frames(), Slots("STREAMS", 1))

    assert reader.read == [b"data: 1\n\n", b""]


async def test_the_error_of_a_stream_reaches_the_boundary() -> None:
    async def frames() -> AsyncIterator[str]:
        yield "data: 1\n\n"
        raise ValueError("broken")

    reader = Reader(stays=True)

    with pytest.raises(ValueError, match="broken"):
        await reader.open(frames(), Slots("STREAMS", 1))


async def test_an_ended_stream_leaves_nothing_for_the_garbage_collector() -> None:
    source = Source()
    is_alive = weakref.ref(source)
    gc.disable()
    try:
        await Reader().open(source.frames(), Slots("STREAMS", 1))
        del source

        assert is_alive() is None
    finally:
        gc.enable()
