"""Waiting for news or a moment of fleet time, whichever comes first."""

import asyncio
from collections.abc import AsyncIterator
from datetime import UTC, datetime, timedelta

import pytest
from skyway_drone_agent.journal.flight_recorder import NewsOrMoment

from skyway.runtime.clock import ManualClock

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)
MINUTE = timedelta(minutes=1)


class CountingClock(ManualClock):
    """Counts how often somebody goes to sleep."""

    def __init__(self) -> None:
        super().__init__(NOON)
        self.sleeps = 0

    async def sleep_until(self, fleet_moment: datetime) -> None:
        self.sleeps += 1
        await super().sleep_until(fleet_moment)


@pytest.fixture
def clock() -> CountingClock:
    return CountingClock()


@pytest.fixture
def news() -> asyncio.Event:
    return asyncio.Event()


@pytest.fixture
async def waiting(news: asyncio.Event, clock: CountingClock) -> AsyncIterator[NewsOrMoment]:
    with NewsOrMoment(news, clock) as made:
        yield made


async def settle() -> None:
    for _ in range(5):
        await asyncio.sleep(0)


async def begin(waiting: NewsOrMoment, until: datetime | None) -> "asyncio.Task[None]":
    begun = asyncio.create_task(waiting.wait(until=until))
    await settle()
    return begun


async def pass_to(clock: CountingClock, moment: datetime) -> None:
    clock.advance(moment - clock.now())
    await settle()


async def test_a_wait_ends_at_its_moment(waiting: NewsOrMoment, clock: CountingClock) -> None:
    wait = await begin(waiting, NOON + MINUTE)

    await pass_to(clock, NOON + 0.9 * MINUTE)
    assert not wait.done()
    await pass_to(clock, NOON + MINUTE)

    assert wait.done()


async def test_news_ends_a_wait_and_is_cleared(waiting: NewsOrMoment, news: asyncio.Event) -> None:
    wait = await begin(waiting, NOON + MINUTE)
    news.set()
    await settle()

    assert wait.done()
    assert not news.is_set()


async def test_a_wait_that_follows_news_lasts_until_its_own_moment(
    waiting: NewsOrMoment, news: asyncio.Event, clock: CountingClock
) -> None:
    await begin(waiting, NOON + MINUTE)
    news.set()
    await settle()

    wait = await begin(waiting, NOON + 3 * MINUTE)

    await pass_to(clock, NOON + 2 * MINUTE)
    assert not wait.done()
    await pass_to(clock, NOON + 3 * MINUTE)
    assert wait.done()


async def test_a_later_wait_for_an_earlier_moment_ends_in_time(
    waiting: NewsOrMoment, news: asyncio.Event, clock: CountingClock
) -> None:
    await begin(waiting, NOON + 9 * MINUTE)
    news.set()
    await settle()

    wait = await begin(waiting, NOON + MINUTE)
    await pass_to(clock, NOON + MINUTE)

    assert wait.done()


async def test_a_moment_that_comes_without_a_waiter_is_no_news(
    waiting: NewsOrMoment, news: asyncio.Event, clock: CountingClock
) -> None:
    await begin(waiting, NOON + MINUTE)
    news.set()
    await settle()
    await pass_to(clock, NOON + 2 * MINUTE)

    wait = await begin(waiting, NOON + 3 * MINUTE)

    assert not wait.done()
    await pass_to(clock, NOON + 3 * MINUTE)
    assert wait.done()


async def test_a_sleep_that_ends_as_a_wait_begins_does_not_end_it(
    waiting: NewsOrMoment, news: asyncio.Event, clock: CountingClock
) -> None:
    await begin(waiting, NOON + MINUTE)
    news.set()
    await settle()
    clock.advance(MINUTE)

    wait = await begin(waiting, NOON + 3 * MINUTE)

    assert not wait.done()


async def test_waits_that_end_by_news_share_a_sleep(
    waiting: NewsOrMoment, news: asyncio.Event, clock: CountingClock
) -> None:
    for minutes in range(1, 11):
        await begin(waiting, NOON + minutes * MINUTE)
        news.set()
        await settle()

    assert clock.sleeps == 1


async def test_leaving_the_block_ends_the_sleep(news: asyncio.Event, clock: CountingClock) -> None:
    before = asyncio.all_tasks()
    with NewsOrMoment(news, clock) as waiting:
        wait = await begin(waiting, NOON + MINUTE)
        wait.cancel()
    await settle()

    assert asyncio.all_tasks() == before
