"""Steps of a start that are tried again."""

import asyncio
from datetime import timedelta

import pytest

from skyway.cli.system.retry import NotNow, until_done
from skyway.errors import SkywayError
from skyway.runtime.clock import ManualClock


class Step:
    """Fails with each of these errors, and then succeeds."""

    def __init__(self, *errors: SkywayError) -> None:
        self.errors = list(errors)
        self.tries = 0

    async def __call__(self) -> str:
        self.tries += 1
        if self.errors:
            raise self.errors.pop(0)
        return "done"


async def while_time_passes(clock: ManualClock, step: Step, said: list[str]) -> str:
    doing = asyncio.create_task(until_done(step, say=said.append, within_s=60.0, clock=clock))
    while not doing.done():
        await asyncio.sleep(0)
        clock.advance(timedelta(seconds=0.5))
    return await doing


async def test_each_cause_is_said_once(clock: ManualClock) -> None:
    step = Step(*[NotNow("no server")] * 3, *[NotNow("it starts")] * 2)
    said: list[str] = []

    result = await while_time_passes(clock, step, said)

    assert (result, step.tries) == ("done", 6)
    assert said == ["no server. Trying again.", "it starts. Trying again."]


async def test_after_its_time_the_cause_is_an_error(clock: ManualClock) -> None:
    step = Step(*[NotNow("port 8000 is in use")] * 1000)

    with pytest.raises(NotNow, match="port 8000"):
        await while_time_passes(clock, step, [])

    assert 30 < step.tries < 100


async def test_an_error_that_cannot_pass_is_raised_immediately(clock: ManualClock) -> None:
    step = Step(SkywayError("a wrong password"))

    with pytest.raises(SkywayError, match="a wrong password"):
        await while_time_passes(clock, step, [])

    assert step.tries == 1
