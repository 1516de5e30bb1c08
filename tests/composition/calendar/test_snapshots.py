"""A plan is committed exactly if nothing that it was made with has changed meanwhile."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from skyway_composition.calendar.commit import Snapshot, WorldChanged, lock_as_seen
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.booking import engage
from skyway_composition.missions.booking.turns import Turns
from skyway_composition.missions.interventions.cancel import cancel_packages
from skyway_composition.missions.mission import store, unit_of_work
from skyway_composition.missions.mission.record import Trouble
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.check_plan import request_plan

from skyway.contracts.mission import CancelMissions
from skyway.ids import DeliveryId, DroneId
from skyway.runtime.sql.database import Database, Tx
from tests.composition.busy_network import NETWORK_ID
from tests.composition.busy_story import BETWEEN_A_AND_B, Story, chosen_actions
from tests.composition.busy_world import BusyWorld
from tests.composition.dispatched_world import PROVIDER, dispatcher_of
from tests.composition.missions.queue.booked_chain import book, request
from tests.composition.watched_calendars import WatchedDatabase, calendars_in

pytestmark = pytest.mark.databases("sqlite")

_IS_GATED: ContextVar[bool] = ContextVar("is_gated", default=False)


@dataclass(slots=True)
class Gate:
    """Keeps a proposal from its transaction of this number until the gate is open."""

    number: int
    is_reached: asyncio.Event = field(default_factory=asyncio.Event)
    is_open: asyncio.Event = field(default_factory=asyncio.Event)


class GatedDatabase(Database):
    """A database with a gate for the proposal of a test."""

    gate: Gate | None = None

    @asynccontextmanager
    async def write(self) -> AsyncIterator[Tx]:
        if self.gate is not None and _IS_GATED.get():
            self.gate.number -= 1
            if self.gate.number == 0:
                self.gate.is_reached.set()
                await self.gate.is_open.wait()
        async with super().write() as tx:
            yield tx


class GatedWorld(BusyWorld):
    database = GatedDatabase


class WatchedWorld(BusyWorld):
    database = WatchedDatabase


async def book_drone(world: BusyWorld, number: int, delivery_id: str, *ways: str) -> None:
    [drone] = world.drones[number - 1 : number]
    asked = request(delivery_id, *ways)
    await world.book(delivery_id, asked, loading="AUTOMATIC", drones=[drone])


async def book_an_idle_drone(world: BusyWorld) -> None:
    await book_drone(world, 3, "new", "b", "c")


async def book_behind_a_mission(world: BusyWorld) -> None:
    await book_drone(world, 2, "new", "c", "a")


async def dispatch(world: BusyWorld) -> None:
    await dispatcher_of(world).look_at(NETWORK_ID, PROVIDER)


async def plan_a_queue_again(world: BusyWorld) -> None:
    async with world.db.write() as tx:
        await store.plan_queue_again(tx, DroneId("drn_1"))
    await world.calendars.look_at(DroneId("drn_1"))


async def plan_a_mission_again(world: BusyWorld) -> None:
    async with world.db.write() as tx:
        work = await MissionUnitOfWork.lock(world.context, tx, [DroneId("drn_2")])
        late = Trouble(code="LATE", detail="for this test")
        await request_plan(work, work.missions[DroneId("drn_2")], late)
    await world.replanner.replan(DroneId("drn_2"))


#: Each proposal, and the transaction in which it is committed.
PROPOSALS: dict[Callable[[BusyWorld], Awaitable[None]], int] = {
    book_an_idle_drone: 1,
    book_behind_a_mission: 1,
    dispatch: 1,
    plan_a_queue_again: 3,
    plan_a_mission_again: 3,
}


async def nothing(world: BusyWorld) -> None:
    pass


async def another_booking_of_drone_2(world: BusyWorld) -> None:
    await book_drone(world, 2, "other", "b", "c")


async def another_booking_of_drone_3(world: BusyWorld) -> None:
    await book_drone(world, 3, "other", "b", "a")


async def a_cancellation_on_drone_1(world: BusyWorld) -> None:
    requested = CancelMissions(cancellation_id="can_1", reason="not needed")
    await cancel_packages(world.context, DeliveryId("dlv4"), requested)


async def a_closed_zone(world: BusyWorld) -> None:
    await world.close("ZONE", area=BETWEEN_A_AND_B)


@pytest.mark.parametrize("proposal", PROPOSALS)
@pytest.mark.parametrize(
    "change",
    [
        nothing,
        another_booking_of_drone_2,
        another_booking_of_drone_3,
        a_cancellation_on_drone_1,
        a_closed_zone,
    ],
)
async def test_of_two_changes_of_one_snapshot_the_second_is_committed_if_they_do_not_meet(
    migrated_url: str,
    monkeypatch: pytest.MonkeyPatch,
    proposal: Callable[[BusyWorld], Awaitable[None]],
    change: Callable[[BusyWorld], Awaitable[None]],
) -> None:
    commits: list[tuple[Snapshot, bool]] = []

    async def noted(tx: Tx, seen: Snapshot, **how: Any) -> dict[DroneId, DroneLink]:
        try:
            links = await lock_as_seen(tx, seen, **how)
        except WorldChanged:
            if _IS_GATED.get():
                commits.append((seen, False))
            raise
        if _IS_GATED.get():
            commits.append((seen, True))
        return links

    monkeypatch.setattr(engage, "lock_as_seen", noted)
    monkeypatch.setattr(unit_of_work, "lock_as_seen", noted)
    async with GatedWorld(migrated_url) as world:
        await _prepare(world)
        gate = world.db.gate = Gate(PROPOSALS[proposal])  # type: ignore[attr-defined]
        proposing = asyncio.create_task(_gated(proposal, world))
        reached = asyncio.create_task(gate.is_reached.wait())
        await asyncio.wait({proposing, reached}, return_when=asyncio.FIRST_COMPLETED)
        assert not proposing.done(), "nothing was proposed"
        before = await calendars_in(world.db)
        # Another replica, where the proposal has no turn.
        world.bookings = replace(world.bookings, turns=Turns(), under_way={})
        await change(world)
        after = await calendars_in(world.db)
        gate.is_open.set()
        await proposing

        (seen, is_committed), *_ = commits
        met = {each for each in seen.calendars if before[each].content != after[each].content}
        assert is_committed == (not met and change is not a_closed_zone)
        await world.check()


async def _gated(proposal: Callable[[BusyWorld], Awaitable[None]], world: BusyWorld) -> None:
    _IS_GATED.set(True)
    await proposal(world)


async def _prepare(world: BusyWorld) -> None:
    """Drone 1 has four missions, and drone 2 has one."""
    for number in range(1, 5):
        assert await book(world, f"dlv{number}", "a", "b", drone=1) == "BOOKED"
    assert await book(world, "dlv5", "b", "c", drone=2) == "BOOKED"


def test_every_change_of_a_calendar_raises_its_number(migrated_url: str) -> None:
    @given(actions=st.just(chosen_actions(Random(3))[:12]))
    def play_story(actions: list[tuple[str, int]]) -> None:
        asyncio.run(Story.play(migrated_url, actions, world_of=WatchedWorld))

    play_story()
