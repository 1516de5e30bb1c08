"""What a request costs: the time that it keeps the event loop busy, and its bytes."""

import asyncio
import gc
import weakref
from typing import Any

import pytest

from skyway.runtime.http.loop_time import (
    LONGEST_PAUSE_S,
    SHORT_PASS_S,
    UNIT_BYTES,
    UNIT_S,
    Account,
    LoopTurns,
    charged,
)
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
    assert cleaned == ["yes"]
    assert loop.spent == pytest.approx(2.0)


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


async def test_a_work_that_ended_by_an_error_leaves_nothing_for_the_garbage_collector(
    loop: Loop,
) -> None:
    class Held:
        pass

    async def work(_held: Held) -> None:
        await asyncio.Event().wait()

    held = Held()
    is_alive = weakref.ref(held)
    task = asyncio.create_task(loop.account().measured(work(held)))
    await asyncio.sleep(0)
    gc.disable()
    try:
        task.cancel()
        await asyncio.wait([task])
        del held, task

        assert is_alive() is None
    finally:
        gc.enable()


class Requests:
    """Requests that wait for their turn, and in which order they begin."""

    def __init__(self, pass_s: float = 0.0, **spent: float) -> None:
        self.now_s, self.pass_s = 1_000.0, pass_s
        self.turns = LoopTurns(lambda who: spent[who], self.now)
        self.begun: list[str] = []
        self.tasks: list[asyncio.Task[None]] = []

    def now(self) -> float:
        """A clock on which each look at it comes one pass of the event loop later."""
        self.now_s += self.pass_s
        return self.now_s

    def ask(self, *names: str) -> None:
        self.tasks += [asyncio.create_task(self._begin(name)) for name in names]

    async def _begin(self, name: str) -> None:
        await self.turns.turn(name)
        self.begun.append(name)

    async def end(self) -> None:
        """Wait until all requests have begun or left, for as many passes as that may take."""
        for _ in range(1_000):
            await asyncio.sleep(0)
        waiting = [task for task in self.tasks if not task.done()]
        for task in waiting:
            task.cancel()
        await asyncio.gather(*self.tasks, return_exceptions=True)
        assert not waiting


async def test_the_caller_that_has_spent_least_begins_first() -> None:
    requests = Requests(mallory=9.0, alice=2.0, bob=3.0)

    requests.ask("mallory", "mallory", "bob", "alice", "alice")
    await requests.end()

    assert requests.begun == ["alice", "alice", "bob", "mallory", "mallory"]


async def test_requests_begin_seldom_while_the_loop_is_busy() -> None:
    requests = Requests(pass_s=2 * SHORT_PASS_S, alice=0.0)
    began_s = requests.now_s

    requests.ask(*["alice"] * 5)
    await requests.end()

    assert requests.now_s - began_s >= 4 * LONGEST_PAUSE_S


async def test_a_caller_that_leaves_gives_up_its_turn() -> None:
    requests = Requests(alice=0.0, bob=1.0)
    requests.ask("alice", "bob")
    await asyncio.sleep(0)

    requests.tasks[0].cancel()
    await requests.end()

    assert (requests.begun, requests.turns.waiting) == (["bob"], 0)


async def test_callers_that_have_left_hold_up_nobody() -> None:
    requests = Requests(pass_s=2 * SHORT_PASS_S, mallory=0.0, bob=1.0)
    requests.ask(*["mallory"] * 20, "bob")
    await asyncio.sleep(0)
    began_s = requests.now_s

    for task in requests.tasks[:20]:
        task.cancel()
    await requests.end()

    assert requests.begun == ["bob"]
    assert requests.now_s - began_s < 2 * LONGEST_PAUSE_S
