"""What a request costs: the time that it keeps the event loop busy, and its bytes."""

import asyncio
from typing import Any

import pytest

from skyway.runtime.http.loop_time import UNIT_BYTES, UNIT_S, Account, charged
from skyway.runtime.limits import Budget, Meter


class Loop:
    """A clock that goes on when a work says so."""

    def __init__(self) -> None:
        self.s = 0.0
        self.meter = Meter(Budget("TENANT_REQUESTS", 1.0, 1_000), now=lambda: 0.0)

    def account(self) -> Account:
        return Account(self.meter, "alice", now=lambda: self.s)

    @property
    def spent(self) -> float:
        return self.meter.spent("alice")


@pytest.fixture
def loop() -> Loop:
    return Loop()


async def test_the_first_unit_of_work_is_included(loop: Loop) -> None:
    async def work() -> str:
        loop.s += UNIT_S
        return "done"

    assert await loop.account().measured(work()) == "done"
    assert loop.spent == 0.0


async def test_further_work_is_charged_also_between_waits(loop: Loop) -> None:
    async def work() -> None:
        for _ in range(3):
            loop.s += UNIT_S
            await asyncio.sleep(0)

    await loop.account().measured(work())

    assert loop.spent == pytest.approx(2.0)


async def test_time_in_which_the_work_waits_is_not_charged(loop: Loop) -> None:
    async def work() -> None:
        await asyncio.gather(someone_else(), asyncio.sleep(0))

    async def someone_else() -> None:
        loop.s += 100 * UNIT_S

    await loop.account().measured(work())

    assert loop.spent == 0.0


async def test_work_that_fails_is_charged(loop: Loop) -> None:
    async def work() -> None:
        await asyncio.sleep(0)
        loop.s += 5 * UNIT_S
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        await loop.account().measured(work())

    assert loop.spent == pytest.approx(4.0)


async def test_a_work_that_is_cancelled_may_clean_up(loop: Loop) -> None:
    cleaned: list[str] = []

    async def work() -> None:
        try:
            await asyncio.Event().wait()
        finally:
            loop.s += 3 * UNIT_S
            cleaned.append("yes")

    task = asyncio.create_task(loop.account().measured(work()))
    await asyncio.sleep(0)
    task.cancel()

    with pytest.raises(asyncio.CancelledError):
        await task
    assert (cleaned, loop.spent) == (["yes"], pytest.approx(2.0))


def test_bytes_are_charged(loop: Loop) -> None:
    account = loop.account()

    account.add_bytes(UNIT_BYTES)
    account.add_bytes(2 * UNIT_BYTES)

    assert loop.spent == pytest.approx(2.0)


async def test_a_request_without_an_account_is_not_measured(loop: Loop) -> None:
    async def work() -> str:
        loop.s += 100 * UNIT_S
        return "done"

    scope: dict[str, Any] = {"state": {}}
    assert await charged(scope, work()) == "done"
    assert loop.spent == 0.0
