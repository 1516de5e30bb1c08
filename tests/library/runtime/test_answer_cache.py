"""Cached answers expire, are renewed in time, and are not asked for twice concurrently."""

import asyncio
from datetime import UTC, datetime, timedelta

import pytest

from skyway.runtime.answer_cache import AnswerCache
from skyway.runtime.clock import ManualClock

KEPT = timedelta(seconds=4)


class World:
    """Answers questions when a test lets it; None to a question without an answer."""

    def __init__(self) -> None:
        self.answers: dict[str, int] = {"two": 2}
        self.asked: list[str] = []
        self.was_asked = asyncio.Event()
        self.is_answering = asyncio.Event()
        self.is_answering.set()
        self.trouble: Exception | None = None

    async def ask(self, question: str) -> int | None:
        self.asked.append(question)
        self.was_asked.set()
        await self.is_answering.wait()
        if self.trouble is not None:
            raise self.trouble
        return self.answers.get(question)


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(datetime(2026, 3, 1, tzinfo=UTC))


@pytest.fixture
def world() -> World:
    return World()


@pytest.fixture
def cache(world: World, clock: ManualClock) -> AnswerCache[str, int | None]:
    return AnswerCache(world.ask, clock=clock, kept=KEPT, most=3)


async def test_an_answer_is_believed_for_its_time(
    cache: AnswerCache[str, int | None], clock: ManualClock
) -> None:
    assert cache.cached("two") is None
    assert await cache.ask("two") == 2
    assert cache.cached("two") == 2

    clock.advance(KEPT)
    assert cache.cached("two") is None


async def test_an_answer_is_not_believed_for_longer_when_the_clock_is_set_back(
    cache: AnswerCache[str, int | None], clock: ManualClock
) -> None:
    await cache.ask("two")

    clock.advance(timedelta(hours=-1))
    assert cache.cached("two") is None


async def test_an_old_answer_is_renewed_while_it_is_believed(
    cache: AnswerCache[str, int | None], clock: ManualClock, world: World
) -> None:
    await cache.ask("two")
    clock.advance(KEPT / 2)
    world.answers["two"] = 22
    world.was_asked.clear()

    assert cache.cached("two") == 2
    await asyncio.wait_for(world.was_asked.wait(), 60)  # nobody but the renewal asks
    clock.advance(KEPT * 0.49)
    assert cache.cached("two") == 22
    assert world.asked == ["two", "two"]


async def test_a_young_answer_is_not_renewed(
    cache: AnswerCache[str, int | None], clock: ManualClock, world: World
) -> None:
    await cache.ask("two")
    clock.advance(KEPT * 0.49)

    assert cache.cached("two") == 2
    await asyncio.sleep(0)
    assert world.asked == ["two"]


async def test_its_time_begins_when_it_is_asked_for(
    cache: AnswerCache[str, int | None], clock: ManualClock, world: World
) -> None:
    world.is_answering.clear()
    asking = asyncio.create_task(cache.ask("two"))
    await world.was_asked.wait()
    clock.advance(KEPT)
    world.is_answering.set()
    await asking

    assert cache.cached("two") is None


async def test_concurrent_callers_share_one_answer(
    cache: AnswerCache[str, int | None], world: World
) -> None:
    assert await asyncio.gather(*(cache.ask("two") for _ in range(5))) == [2] * 5
    assert world.asked == ["two"]


async def test_a_cancelled_caller_leaves_the_answer_to_the_others(
    cache: AnswerCache[str, int | None], world: World
) -> None:
    world.is_answering.clear()
    first, second = (asyncio.create_task(cache.ask("two")) for _ in range(2))
    await asyncio.sleep(0)
    first.cancel()
    await asyncio.sleep(0)
    world.is_answering.set()

    assert await second == 2


async def test_an_answer_of_none_is_not_cached(
    cache: AnswerCache[str, int | None], clock: ManualClock, world: World
) -> None:
    await cache.ask("two")
    clock.advance(KEPT / 2)
    del world.answers["two"]

    assert await cache.ask("two") is None
    assert cache.cached("two") is None


async def test_a_failed_renewal_keeps_the_cached_answer(
    cache: AnswerCache[str, int | None], clock: ManualClock, world: World
) -> None:
    await cache.ask("two")
    clock.advance(KEPT / 2)
    world.trouble = OSError("nobody there")

    assert cache.cached("two") == 2
    with pytest.raises(OSError, match="nobody there"):
        await cache.ask("two")
    assert cache.cached("two") == 2


async def test_an_answer_under_way_is_forgotten_too(
    cache: AnswerCache[str, int | None], world: World
) -> None:
    world.is_answering.clear()
    asking = asyncio.create_task(cache.ask("two"))
    await asyncio.sleep(0)
    cache.clear()
    again = asyncio.create_task(cache.ask("two"))
    await asyncio.sleep(0)
    world.answers["two"] = 22
    world.is_answering.set()
    await asyncio.gather(asking, again)

    assert world.asked == ["two", "two"]
    assert cache.cached("two") == 22


async def test_no_more_is_remembered_than_may_be(
    cache: AnswerCache[str, int | None], world: World
) -> None:
    world.answers = {name: number for number, name in enumerate("abcd")}
    for name in "abc":
        await cache.ask(name)
    await cache.ask("c")  # not one more
    assert [cache.cached(name) for name in "abc"] == [0, 1, 2]

    await cache.ask("d")
    assert [cache.cached(name) for name in "abcd"] == [None, None, None, 3]
