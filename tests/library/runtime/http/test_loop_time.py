"""What a request costs: the time that it keeps the event loop busy, and its bytes."""

import asyncio
import gc
import weakref
from collections.abc import AsyncIterator
from typing import Any

import pytest

from skyway.runtime.http.loop_time import (
    BEHIND_S,
    CREDIT_S,
    LONGEST_PAUSE_S,
    SHARE,
    SHORT_PAUSE_S,
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

    def __init__(self, **spent: float) -> None:
        self.now_s = 1_000.0
        self.turns = LoopTurns(lambda who: spent.get(who, 0.0), lambda: self.now_s)
        self.begun: list[str] = []
        self.tasks: list[asyncio.Task[None]] = []

    async def ask(self, *names: str) -> None:
        """Ask, before any of these requests begins."""
        self.tasks += [asyncio.create_task(self._begin(name)) for name in names]
        await asyncio.sleep(0)

    async def _begin(self, name: str) -> None:
        await self.turns.turn(name)
        self.begun.append(name)

    async def after(self, pause_s: float) -> list[str]:
        """Who has begun this many seconds of the clock later."""
        self.now_s += pause_s
        for _ in range(100):
            self.turns.look()
            await asyncio.sleep(0)
        return self.begun

    async def end(self) -> None:
        """Let all requests that still wait leave."""
        for task in self.tasks:
            task.cancel()
        await asyncio.gather(*self.tasks, return_exceptions=True)


@pytest.fixture
async def requests() -> AsyncIterator[Requests]:
    made = Requests(mallory=9.0, alice=2.0, bob=3.0)
    yield made
    await made.end()


async def test_the_caller_that_has_spent_least_begins_first(requests: Requests) -> None:
    requests.turns.note(1.0)
    await requests.ask("mallory", "bob", "alice")

    assert await requests.after(0.0) == ["alice"]
    assert await requests.after(SHORT_PAUSE_S) == ["alice", "bob"]
    assert await requests.after(SHORT_PAUSE_S) == ["alice", "bob", "mallory"]


async def test_who_asks_one_thing_passes_who_asks_many_things_together(
    requests: Requests,
) -> None:
    requests.turns.note(1.0)
    await requests.ask("dave", "dave", "dave")
    await requests.after(0.0)

    await requests.ask("mallory")

    assert (await requests.after(SHORT_PAUSE_S))[:2] == ["dave", "mallory"]


async def test_a_request_that_has_waited_for_long_begins_before_new_ones(
    requests: Requests,
) -> None:
    requests.turns.note(1.0)
    await requests.ask("dave", "dave")
    assert await requests.after(0.0) == ["dave"]

    requests.now_s += BEHIND_S + 1.0
    await requests.ask("carol")

    assert await requests.after(LONGEST_PAUSE_S) == ["dave", "dave", "carol"]


async def test_requests_together_take_a_share_of_the_event_loop(requests: Requests) -> None:
    await requests.ask("dave", "dave")
    requests.turns.note(2 * CREDIT_S * SHARE)

    pauses_s = (0.0, 0.9 * CREDIT_S, 0.2 * CREDIT_S)
    begun = [len(await requests.after(pause_s)) for pause_s in pauses_s]

    assert begun == [1, 1, 2]


async def test_little_work_delays_no_request(requests: Requests) -> None:
    await requests.ask("dave", "dave", "dave")

    requests.turns.note(0.9 * CREDIT_S * SHARE)

    assert await requests.after(0.0) == ["dave", "dave", "dave"]


async def test_requests_begin_seldom_while_the_loop_is_busy(requests: Requests) -> None:
    await requests.ask("dave", "dave")
    requests.turns.note(1.0)
    await requests.after(0.0)

    requests.now_s += 0.9 * LONGEST_PAUSE_S
    requests.turns.note(1.0)
    assert await requests.after(0.0) == ["dave"]

    assert await requests.after(0.2 * LONGEST_PAUSE_S) == ["dave", "dave"]


async def test_the_loop_is_free_again_soon_after_much_work(requests: Requests) -> None:
    requests.turns.note(100.0)
    await requests.ask("dave", "dave")

    assert await requests.after(1.1 * LONGEST_PAUSE_S) == ["dave", "dave"]


async def test_callers_with_one_request_do_not_begin_all_at_the_same_time(
    requests: Requests,
) -> None:
    requests.turns.note(1.0)
    await requests.ask("alice", "bob")

    assert await requests.after(0.0) == ["alice"]
    assert await requests.after(SHORT_PAUSE_S) == ["alice", "bob"]


async def test_a_request_begins_without_a_look_from_outside(requests: Requests) -> None:
    await requests.ask("alice")

    await asyncio.wait_for(requests.tasks[0], 10.0)

    assert requests.begun == ["alice"]


async def test_callers_that_have_left_hold_up_nobody(requests: Requests) -> None:
    requests.turns.note(1.0)
    await requests.ask(*(f"mallory {number}" for number in range(20)), "bob")

    for task in requests.tasks[:20]:
        task.cancel()
    await asyncio.sleep(0)

    assert await requests.after(0.0) == ["bob"]
    assert requests.turns.waiting == 0
