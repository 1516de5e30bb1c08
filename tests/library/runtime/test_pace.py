"""Turns of what many ask for at once."""

import asyncio
import time

from skyway.runtime.pace import Pace


async def test_the_first_turn_after_a_rest_begins_at_once() -> None:
    pace = Pace(every_s=3600.0)

    async with asyncio.timeout(10.0):
        await pace.turn()


async def test_turns_begin_no_faster_than_their_pace() -> None:
    pace = Pace(every_s=0.05)
    await pace.turn()
    began_s = time.monotonic()

    await pace.turn()
    await pace.turn()

    assert time.monotonic() - began_s >= 0.09


async def test_without_a_pace_nobody_waits() -> None:
    pace = Pace()

    async with asyncio.timeout(10.0):
        for _ in range(1_000):
            await pace.turn()
