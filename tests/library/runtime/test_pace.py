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


async def test_turns_that_were_not_taken_may_be_taken_later() -> None:
    pace = Pace(every_s=3600.0, burst=3)

    async with asyncio.timeout(10.0):
        for _ in range(4):
            await pace.turn()
    late = asyncio.create_task(pace.turn())
    await asyncio.wait([late], timeout=0.05)
    is_waiting = not late.done()
    late.cancel()

    assert is_waiting


async def test_turns_of_a_burst_keep_apart() -> None:
    pace = Pace(every_s=3600.0, burst=3, least_s=0.05)
    await pace.turn()
    began_s = time.monotonic()

    await pace.turn()
    await pace.turn()

    assert time.monotonic() - began_s >= 0.09
