"""The booking loop: several bookings at the same time, none waits for a slow or failed one."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest
from skyway_gateway.deliveries.booking.run_bookings import BookingLoop

from skyway.runtime.loops import Wake


@dataclass
class Booker:
    """A queue of names; each is booked when its gate opens, and the broken ones fail."""

    waiting: list[str]
    queued: Wake = field(default_factory=Wake)
    under_way: set[str] = field(default_factory=set)
    booked: list[str] = field(default_factory=list)
    looks: int = 0
    gate: asyncio.Event = field(default_factory=asyncio.Event)
    held: asyncio.Queue[frozenset[str]] = field(default_factory=asyncio.Queue)

    async def claim(self, *, limit: int) -> list[Any]:
        self.looks += 1
        taken, self.waiting = self.waiting[:limit], self.waiting[limit:]
        return [_queued(name) for name in taken]

    async def hold(self, deliveries: frozenset[str]) -> None:
        self.held.put_nowait(deliveries)

    async def book_or_retry(self, queued: Any) -> None:
        name = queued.delivery.delivery_id
        self.under_way.add(name)
        if name.startswith("slow"):
            await self.gate.wait()
        if name.startswith("broken"):
            raise RuntimeError(name)
        self.under_way.discard(name)
        self.booked.append(name)


Until = Callable[[Callable[[], bool]], Awaitable[None]]


@pytest.fixture
def until() -> Until:
    async def wait(is_so: Callable[[], bool]) -> None:
        async with asyncio.timeout(60):
            while not is_so():  # noqa: ASYNC110 - it is the loop under test that goes on
                await asyncio.sleep(0)

    return wait


def _queued(name: str) -> Any:
    return SimpleNamespace(delivery=SimpleNamespace(delivery_id=name))


async def _run(
    booker: Booker,
    most: int,
    test: Callable[[], Awaitable[None]],
    *,
    loop: BookingLoop | None = None,
) -> None:
    loop = loop or BookingLoop(booker.queued, claimant="bkr_1", most=most)
    fake: Any = booker
    running = asyncio.create_task(loop.run(fake))
    try:
        await test()
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


async def test_a_slow_booking_holds_up_no_other(until: Until) -> None:
    booker = Booker(["slow 1", "a", "b", "c", "d"])

    async def test() -> None:
        await until(lambda: booker.booked == ["a", "b", "c", "d"])
        assert booker.under_way == {"slow 1"}

    await _run(booker, 2, test)


async def test_no_more_than_the_limit_are_booked_at_the_same_time(until: Until) -> None:
    booker = Booker(["slow 1", "slow 2", "slow 3"])

    async def test() -> None:
        await until(lambda: len(booker.under_way) == 2)
        booker.queued.set()
        for _ in range(20):
            await asyncio.sleep(0)
        assert booker.under_way == {"slow 1", "slow 2"}
        booker.gate.set()
        await until(lambda: len(booker.booked) == 3)

    await _run(booker, 2, test)


async def test_a_failed_booking_does_not_disturb_the_others(until: Until) -> None:
    booker = Booker(["broken", "a"])

    async def test() -> None:
        await until(lambda: booker.booked == ["a"])
        booker.waiting.append("b")
        booker.queued.set()
        await until(lambda: booker.booked == ["a", "b"])

    await _run(booker, 2, test)


async def test_one_look_claims_everything_that_is_due(until: Until) -> None:
    booker = Booker(["slow 1", "slow 2", "slow 3"])

    async def test() -> None:
        await until(lambda: len(booker.under_way) == 3)
        assert booker.looks == 1

    await _run(booker, 8, test)


async def test_a_delivery_that_is_handed_over_is_booked_without_a_look(until: Until) -> None:
    booker = Booker([])
    loop = BookingLoop(booker.queued, claimant="bkr_1", most=2)
    assert not loop.is_free

    async def test() -> None:
        await until(lambda: loop.is_free)
        loop.begin(_queued("a"))
        await until(lambda: booker.booked == ["a"])
        assert booker.looks == 1

    await _run(booker, 2, test, loop=loop)
    assert not loop.is_free
    loop.begin(_queued("late"))
    assert booker.booked == ["a"]


async def test_nothing_is_handed_over_while_older_deliveries_wait(until: Until) -> None:
    booker = Booker(["slow 1", "slow 2", "slow 3"])
    loop = BookingLoop(booker.queued, claimant="bkr_1", most=2)

    async def test() -> None:
        await until(lambda: len(booker.under_way) == 2)
        assert not loop.is_free
        booker.gate.set()
        await until(lambda: len(booker.booked) == 3)
        await until(lambda: loop.is_free)

    await _run(booker, 2, test, loop=loop)


async def test_deliveries_are_handed_over_up_to_the_limit(until: Until) -> None:
    booker = Booker([])
    loop = BookingLoop(booker.queued, claimant="bkr_1", most=2)

    async def test() -> None:
        await until(lambda: loop.is_free)
        loop.begin(_queued("slow 1"))
        assert loop.is_free
        loop.begin(_queued("slow 2"))
        assert not loop.is_free

    await _run(booker, 2, test, loop=loop)


async def test_deliveries_of_one_commit_beyond_the_limit_wait(until: Until) -> None:
    booker = Booker([])
    loop = BookingLoop(booker.queued, claimant="bkr_1", most=2)

    async def test() -> None:
        await until(lambda: loop.is_free)
        for name in ("slow 1", "slow 2", "slow 3"):
            loop.begin(_queued(name))
        for _ in range(20):
            await asyncio.sleep(0)
        assert booker.under_way == {"slow 1", "slow 2"}
        booker.gate.set()
        await until(lambda: len(booker.booked) == 3)

    await _run(booker, 2, test, loop=loop)


async def test_claims_of_running_bookings_are_renewed() -> None:
    booker = Booker(["slow 1", "a", "slow 2"])

    async def test() -> None:
        async with asyncio.timeout(60):
            while len(await booker.held.get()) > 2:  # the first renewal may include "a"
                pass
            assert await booker.held.get() == {"slow 1", "slow 2"}

    await _run(booker, 3, test)
