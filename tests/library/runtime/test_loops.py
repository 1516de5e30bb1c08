"""Loops that run for as long as a process lives."""

import asyncio

import pytest

from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.loops import Loops, Wake, repeat
from skyway.runtime.metrics import COUNTERS


class Steps:
    """Steps of a loop: answers in turn, and the last one for ever."""

    def __init__(self, *answers: bool | Exception) -> None:
        self.answers = list(answers)
        self.taken = 0
        self.reached = asyncio.Event()
        self.wanted = len(answers)

    async def __call__(self) -> bool:
        self.taken += 1
        answer = self.answers.pop(0) if self.answers else False
        if self.taken >= self.wanted:
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
