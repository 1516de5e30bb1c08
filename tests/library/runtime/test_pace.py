"""Turns of work that many callers ask for together, on a clock that the test moves."""

import asyncio
from datetime import UTC, datetime, timedelta

import pytest

from skyway.runtime.clock import ManualClock
from skyway.runtime.pace import Pace

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)


@pytest.fixture(params=[1.0, 60.0])
def clock(request: pytest.FixtureRequest) -> ManualClock:
    """A clock that stands; a pace is in wall time, however fast fleet time runs."""
    return ManualClock(NOON, rate=request.param)


async def pass_wall_time(clock: ManualClock, seconds: float) -> None:
    clock.advance(timedelta(seconds=seconds * clock.rate))
    await settle()


async def settle() -> None:
    for _ in range(50):
        await asyncio.sleep(0)


async def turns_begun(pace: Pace, clock: ManualClock, *, after_s: list[float]) -> list[int]:
    """How many of ten turns have begun after each of these spans of wall time."""
    begun = 0

    async def take_turns() -> None:
        nonlocal begun
        for _ in range(10):
            await pace.turn()
            begun += 1

    turning = asyncio.create_task(take_turns())
    await settle()
    counts = []
    for seconds in after_s:
        await pass_wall_time(clock, seconds)
        counts.append(begun)
    turning.cancel()
    return counts


async def test_the_first_turn_begins_immediately(clock: ManualClock) -> None:
    pace = Pace(every_s=3600.0, clock=clock)

    assert await turns_begun(pace, clock, after_s=[0.0]) == [1]


async def test_turns_begin_no_faster_than_their_pace(clock: ManualClock) -> None:
    pace = Pace(every_s=2.0, clock=clock)

    assert await turns_begun(pace, clock, after_s=[1.9, 0.1, 1.9, 0.1]) == [1, 2, 2, 3]


async def test_without_a_pace_nobody_waits(clock: ManualClock) -> None:
    pace = Pace(clock=clock)

    assert await turns_begun(pace, clock, after_s=[0.0]) == [10]


async def test_unused_turns_may_be_used_later(clock: ManualClock) -> None:
    pace = Pace(every_s=3600.0, burst=3, clock=clock)

    assert await turns_begun(pace, clock, after_s=[0.0, 3599.0, 1.0]) == [4, 4, 5]


async def test_turns_of_a_burst_keep_apart(clock: ManualClock) -> None:
    pace = Pace(every_s=3600.0, burst=3, least_s=0.5, clock=clock)

    assert await turns_begun(pace, clock, after_s=[0.0, 0.4, 0.1, 0.5, 0.5, 0.5]) == [
        1,
        1,
        2,
        3,
        4,
        4,
    ]


async def test_a_wall_clock_that_is_set_back_delays_a_turn_by_one_span_at_most() -> None:
    clock = ManualClock(NOON)
    pace = Pace(every_s=2.0, clock=clock)
    await pace.turn()

    clock.advance(timedelta(hours=-1))

    assert await turns_begun(pace, clock, after_s=[0.0, 2.0]) == [1, 2]
