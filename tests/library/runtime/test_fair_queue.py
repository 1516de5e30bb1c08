"""Heavy work is shared between tenants."""

import asyncio
from collections.abc import AsyncIterator

import pytest

from skyway.runtime.errors import BudgetSpent
from skyway.runtime.fair_queue import FairQueue


class Works:
    """Works that run until the test ends them."""

    def __init__(self, queue: FairQueue) -> None:
        self.queue = queue
        self.begun: list[str] = []
        self._running: dict[str, asyncio.Event] = {}
        self.tasks: dict[str, asyncio.Task[None]] = {}

    async def start(self, *names: str) -> None:
        """Start works such as "alice 1"."""
        for name in names:
            self.tasks[name] = asyncio.create_task(self._work(name))
        await settle()

    async def end(self, name: str) -> None:
        self._running.pop(name).set()
        await settle()

    async def _work(self, name: str) -> None:
        async with self.queue.turn(name.split(" ", maxsplit=1)[0]):
            self.begun.append(name)
            self._running[name] = asyncio.Event()
            await self._running[name].wait()


async def settle() -> None:
    """Let all tasks go on until they wait."""
    for _ in range(10):
        await asyncio.sleep(0)


@pytest.fixture
async def works() -> AsyncIterator[Works]:
    made = Works(FairQueue("PLANNING", at_once=2, per_tenant=2, most_waiting=3))
    yield made
    for task in made.tasks.values():
        task.cancel()
    await asyncio.gather(*made.tasks.values(), return_exceptions=True)
    assert not made.queue._running
    assert not made.queue._waiting


async def test_works_within_the_room_begin_without_waiting(works: Works) -> None:
    await works.start("alice 1", "bob 1")

    assert works.begun == ["alice 1", "bob 1"]


async def test_tenants_take_turns_even_if_one_of_them_has_more_waiting(works: Works) -> None:
    await works.start("mallory 1", "mallory 2", "mallory 3", "mallory 4", "alice 1", "bob 1")

    await works.end("mallory 1")
    await works.end("mallory 2")
    await works.end("mallory 3")

    assert works.begun[2:] == ["mallory 3", "alice 1", "bob 1"]


async def test_a_tenant_may_not_have_all_of_the_room_if_it_is_limited() -> None:
    works = Works(FairQueue("PLANNING", at_once=3, per_tenant=1, most_waiting=9))
    await works.start("mallory 1", "mallory 2", "alice 1", "bob 1")

    assert works.begun == ["mallory 1", "alice 1", "bob 1"]
    for name in ("mallory 1", "mallory 2", "alice 1", "bob 1"):
        await works.end(name)


async def test_a_tenant_with_too_many_waiting_is_refused(works: Works) -> None:
    await works.start(*(f"mallory {number}" for number in range(5)))
    assert works.queue.waiting("mallory") == 3

    with pytest.raises(BudgetSpent, match="PLANNING"):
        async with works.queue.turn("mallory"):
            pass
    await works.start("alice 1")
    await works.end("mallory 0")
    await works.end("mallory 1")
    assert "alice 1" in works.begun


async def test_a_caller_that_leaves_gives_up_its_place(works: Works) -> None:
    await works.start("mallory 1", "mallory 2", "alice 1", "alice 2")
    works.tasks["alice 1"].cancel()
    await settle()

    await works.end("mallory 1")

    assert works.begun == ["mallory 1", "mallory 2", "alice 2"]


async def test_a_caller_that_leaves_in_the_moment_of_its_turn_is_passed_over(
    works: Works,
) -> None:
    await works.start("mallory 1", "mallory 2", "alice 1", "alice 2", "bob 1")
    works.tasks["alice 1"].cancel()
    works._running.pop("mallory 1").set()
    await settle()

    assert works.begun[-1] == "alice 2"
    await works.end("mallory 2")
    assert works.begun[-1] == "bob 1"


async def test_a_caller_that_leaves_when_its_turn_has_come_passes_it_on(works: Works) -> None:
    await works.start("mallory 1", "mallory 2", "alice 1", "bob 1")
    works._running.pop("mallory 1").set()
    await asyncio.sleep(0)
    works.tasks["alice 1"].cancel()
    await settle()

    assert works.begun[-1] == "bob 1"
