"""Token buckets: what is taken, what comes back, and what is remembered."""

import asyncio
from collections.abc import AsyncIterator

import pytest

from skyway.runtime.errors import BudgetSpent
from skyway.runtime.limits import Budget, FairQueue, Meter, Slots


class Clock:
    """Seconds that a test sets."""

    def __init__(self) -> None:
        self.now_s = 1_000.0

    def __call__(self) -> float:
        return self.now_s


BUDGET = Budget("CALLS", per_s=10.0, burst=20)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def meter(clock: Clock) -> Meter:
    return Meter(BUDGET, most=3, now=clock)


def taken(meter: Meter, who: str, most: int = 100) -> int:
    """How many can be taken now."""
    for number in range(most):
        try:
            meter.spend(who)
        except BudgetSpent:
            return number
    return most


def test_the_burst_is_there_at_first_and_not_more(meter: Meter) -> None:
    assert taken(meter, "alice") == 20


def test_a_steady_use_at_the_refill_rate_is_never_refused(meter: Meter, clock: Clock) -> None:
    for _ in range(1_000):
        meter.spend("alice")
        clock.now_s += 0.1

    assert meter.read("alice").left == 20


def test_a_spent_budget_refills_with_time_up_to_the_burst(meter: Meter, clock: Clock) -> None:
    taken(meter, "alice")

    clock.now_s += 0.55
    assert taken(meter, "alice") == 5
    clock.now_s += 3_600.0
    assert taken(meter, "alice") == 20


def test_a_refusal_says_which_budget_and_when_to_try_again(meter: Meter, clock: Clock) -> None:
    taken(meter, "alice")

    with pytest.raises(BudgetSpent, match="CALLS") as refusal:
        meter.spend("alice", 5)

    assert refusal.value.code == "CALLS"
    assert refusal.value.retry_after_s == pytest.approx(0.5)
    clock.now_s += refusal.value.retry_after_s + 1e-9
    meter.spend("alice", 5)


def test_a_refused_call_costs_nothing(meter: Meter, clock: Clock) -> None:
    taken(meter, "alice")
    for _ in range(1_000):
        with pytest.raises(BudgetSpent):
            meter.spend("alice")

    clock.now_s += 0.11
    meter.spend("alice")


def test_one_caller_does_not_spend_the_budget_of_another(meter: Meter) -> None:
    taken(meter, "alice")

    assert meter.read("bob").left == 20


def test_a_charge_takes_at_most_what_is_left(meter: Meter, clock: Clock) -> None:
    meter.charge("alice", 1_000)

    assert meter.read("alice").left == 0
    clock.now_s += 2.0
    assert meter.read("alice").left == 20


def test_what_is_given_back_never_exceeds_the_burst(meter: Meter) -> None:
    meter.spend("alice", 10)
    meter.charge("alice", -500)

    assert taken(meter, "alice") == 20


def test_the_headers_say_what_is_left(meter: Meter) -> None:
    assert meter.spend("alice", 5).headers == {
        "RateLimit-Limit": "20",
        "RateLimit-Remaining": "15",
        "RateLimit-Reset": "1",
        "RateLimit-Policy": "20;w=2",
    }


def test_the_memory_is_bounded_and_forgets_who_was_longest_silent(
    meter: Meter, clock: Clock
) -> None:
    for who in ("alice", "bob", "carol", "alice", "dora"):
        meter.spend(who, 5)
        clock.now_s += 0.001
    for number in range(10_000):
        assert meter.remembered <= 3
        if number % 2:
            meter.spend("alice", 0.0001)
        meter.spend(f"x{number}")

    assert meter.remembered == 3
    assert meter.read("alice").left < 20


def test_a_clock_that_goes_back_delays_nobody_longer_than_a_whole_bucket(
    meter: Meter, clock: Clock
) -> None:
    taken(meter, "alice")
    clock.now_s -= 900.0

    assert meter.read("alice").full_after_s == pytest.approx(2.0)
    with pytest.raises(BudgetSpent) as refusal:
        meter.spend("alice")
    assert refusal.value.retry_after_s == pytest.approx(0.1)


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


def test_a_slot_is_given_back_when_its_work_fails() -> None:
    slots = Slots("STREAMS", 1)

    for _ in range(2):
        with pytest.raises(LookupError), slots.held("alice"):
            raise LookupError("the stream broke")

    assert slots.used("alice") == 0
