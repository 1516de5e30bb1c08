"""Loops that go on after an error, and turns of work that many callers ask for together."""

import asyncio
from datetime import UTC, datetime, timedelta

import pytest

from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.loops import Loops, Pace, Wake, repeat
from skyway.runtime.metrics import COUNTERS


class Steps:
    """Steps of a loop: answers in turn, and the last one for ever."""

    def __init__(self, *answers: bool | Exception) -> None:
        self.answers = list(answers)
        self.taken = 0
        self.reached = asyncio.Event()
        self.required = len(answers)

    async def __call__(self) -> bool:
        self.taken += 1
        answer = self.answers.pop(0) if self.answers else False
        if self.taken >= self.required:
            self.reached.set()
        if isinstance(answer, Exception):
            raise answer
        return answer


async def until(event: asyncio.Event) -> None:
    async with asyncio.timeout(60):
        await event.wait()


async def test_a_step_with_more_to_do_runs_again_immediately() -> None:
    steps = Steps(True, True, False)

    async with Loops() as loops:
        loops.start("test", repeat("test", steps, every_s=3600))
        await until(steps.reached)

    assert steps.taken == 3


async def test_a_woken_loop_does_not_wait_its_time() -> None:
    steps, wake = Steps(False, False), Wake()
    wake.set()

    async with Loops() as loops:
        loops.start("test", repeat("test", steps, every_s=3600, wake=wake))
        await until(steps.reached)


async def test_a_loop_runs_again_after_its_time() -> None:
    steps = Steps(False, False, False)

    async with Loops() as loops:
        loops.start("test", repeat("test", steps, every_s=0.001))
        await until(steps.reached)


async def test_a_loop_that_does_not_poll_runs_only_when_it_is_woken() -> None:
    steps, wake, asked = Steps(False, False), Wake(), asyncio.Event()

    def polls() -> bool:
        asked.set()
        return False

    async with Loops() as loops:
        loops.start("test", repeat("test", steps, every_s=0.001, wake=wake, polls=polls))
        await until(asked)
        assert steps.taken == 1
        wake.set()
        await until(steps.reached)

    assert steps.taken == 2


async def test_a_failing_step_is_logged_counted_and_tried_again(
    caplog: pytest.LogCaptureFixture,
) -> None:
    steps = Steps(LookupError("lost"), False)

    async with Loops() as loops:
        loops.start("test", repeat("failing test", steps, every_s=3600))
        await until(steps.reached)

    assert [record.getMessage() for record in caplog.records] == ["loop step failed"]
    assert COUNTERS.value("skyway_loop_failures", loop="failing test") == 1.0


async def test_a_part_that_is_away_is_named_once_and_the_end_of_the_wait_too(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level("INFO")
    gone, refused = (ServiceUnavailable("database", each) for each in ("gone", "refused"))
    steps = Steps(gone, refused, refused, False)

    async with Loops() as loops:
        loops.start("test", repeat("waiting test", steps, every_s=3600))
        await until(steps.reached)
        await asyncio.sleep(0)

    said = [(record.levelname, record.getMessage()) for record in caplog.records]
    assert said == [("WARNING", "loop waits"), ("INFO", "loop goes on")]
    assert COUNTERS.value("skyway_loop_failures", loop="waiting test") == 3.0


async def test_leaving_the_block_cancels_every_loop() -> None:
    ended: list[str] = []

    async def linger(name: str) -> None:
        try:
            await asyncio.Event().wait()
        finally:
            ended.append(name)

    async with Loops() as loops:
        loops.start("a", linger("a"))
        loops.start("b", linger("b"))
        await asyncio.sleep(0)

    assert ended == ["a", "b"]


async def test_an_error_in_the_block_leaves_it_and_no_loop_behind() -> None:
    async def fail() -> None:
        async with Loops() as loops:
            loops.start("test", repeat("test", Steps(False), every_s=3600))
            raise LookupError

    with pytest.raises(ExceptionGroup) as raised:
        await fail()

    assert raised.value.subgroup(LookupError) is not None


async def test_a_wake_set_before_the_wait_is_not_lost_and_counts_once() -> None:
    wake = Wake()
    wake.set()
    wake.set()

    async with asyncio.timeout(60):
        await wake.wait(3600)
        await wake.wait(0.001)


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
