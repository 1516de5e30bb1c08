"""Chains of missions on one drone, while delays, restarts and cut standbys change them."""

import asyncio
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.planning.solver_pool import SolverPool
from skyway_drone_agent.simulated.disturbances import Disturbances

from skyway.delivery.plan import Plan
from skyway.planner.problem import Problem
from skyway.runtime.clock import ManualClock
from tests.composition.busy_world import BusyWorld
from tests.composition.missions.queue.booked_chain import (
    CHAIN,
    book,
    book_chain,
    delivered_by,
    etas,
    kinds_of,
    pass_minutes,
    reports_of,
    waiting,
)
from tests.long_cases import sampled

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


@pytest.mark.long
async def test_six_deliveries_of_one_drone_arrive_in_the_order_of_asking(world: BusyWorld) -> None:
    await book_chain(world)
    assert await book(world, "dlv6", "a", "c") == "BOOKED"
    assert await waiting(world) == ["dlv2", "dlv3", "dlv4", "dlv5", "dlv6"]

    await world.end()

    assert delivered_by(world) == [*CHAIN, "dlv6"]


@pytest.mark.parametrize("rate", sampled([600.0, 1.0], every=2))
async def test_a_chain_is_flown_at_every_clock_rate(migrated_url: str, rate: float) -> None:
    async with BusyWorld(migrated_url, rate=rate) as world:
        await book_chain(world, 3)

        await world.end()

        assert delivered_by(world) == ["dlv1", "dlv2", "dlv3"]


async def test_a_late_mission_moves_the_missions_behind_it_and_their_customers_are_notified(
    world: BusyWorld,
) -> None:
    await book_chain(world, 2)
    promised = await etas(world)
    (drone, *_) = world.drones
    drone.disturbances = Disturbances.model_validate({"flight_time_factor": 1.6})
    await drone.restart(with_journal=True)

    await pass_minutes(world, 60)

    delivered = {each: (await reports_of(world, each)) for each in ("dlv1", "dlv2")}
    at = {
        name: next(each.at for each in reports if each.kind == "DELIVERED")
        for name, reports in delivered.items()
    }
    assert delivered_by(world) == ["dlv1", "dlv2"]
    assert at["dlv2"] > promised["dlv2"]
    assert (await kinds_of(world, "dlv2"))["REPLANNED"] >= 1
    await world.end()


async def test_a_shift_below_two_minutes_is_no_news_for_the_customer(world: BusyWorld) -> None:
    await book_chain(world, 2)
    (drone, *_) = world.drones
    drone.disturbances = Disturbances.model_validate({"flight_time_factor": 1.05})
    await drone.restart(with_journal=True)

    await pass_minutes(world, 16)

    kinds = await kinds_of(world, "dlv2")
    assert (kinds["REPLANNED"], kinds["ACCEPTED"]) == (0, 1)
    await world.end()


async def test_composition_that_is_killed_after_booking_sends_the_mission_later(
    world: BusyWorld,
) -> None:
    await book_chain(world, 3)

    for _ in range(6):
        world.restart()
        await world.handler.ask_live_drones(lambda _drone_id: True)
        await pass_minutes(world, 7)
    await world.end()

    assert delivered_by(world) == ["dlv1", "dlv2", "dlv3"]


async def test_a_drone_that_charges_at_home_stops_for_its_next_mission(world: BusyWorld) -> None:
    await book_chain(world, 1)
    await pass_minutes(world, 75)
    (charging,) = await world.planned()
    assert charging.mission.home_recharge is not None
    assert world.drones[0].logbook.station_id == "a"

    assert await book(world, "dlv2", "a", "b") == "BOOKED"

    await pass_minutes(world, 40)
    assert "dlv2" in delivered_by(world) or await waiting(world) == []
    await world.end()
    assert delivered_by(world) == ["dlv1", "dlv2"]


async def test_a_drone_on_its_way_home_begins_its_next_mission_at_its_landing(
    world: BusyWorld,
) -> None:
    await book_chain(world, 1)
    await pass_minutes(world, 14)
    assert world.drones[0].logbook.station_id is None

    assert await book(world, "dlv2", "a", "b") == "BOOKED"

    first, second = await world.planned()
    assert second.start.station_id == "a"
    assert second.start.at_ms < first.served_ms + 1_800_000
    await world.end()
    assert delivered_by(world) == ["dlv1", "dlv2"]


@pytest.mark.long
async def test_two_customers_who_want_the_same_place_in_a_calendar_both_get_one(
    world: BusyWorld,
) -> None:
    await book_chain(world, 1)

    outcomes = [*await asyncio.gather(book(world, "dlv2", "b", "c"), book(world, "dlv7", "b", "c"))]

    assert outcomes == ["BOOKED", "BOOKED"]
    _, second, third = await world.planned()
    assert second.served_ms < third.start.at_ms
    await world.check()
    await world.end()
    assert sorted(delivered_by(world)) == ["dlv1", "dlv2", "dlv7"]


@pytest.mark.long
async def test_a_drone_charges_at_home_before_a_mission_that_begins_hours_later(
    world: BusyWorld,
) -> None:
    await book_chain(world, 1)
    later_at = world.clock.now().replace(hour=18)
    assert await book(world, "dlv2", "b", "c", earliest_pickup_at=later_at) == "BOOKED"

    _, later = await world.planned()

    assert later.start.station_id == "a"
    assert later.start.soc == pytest.approx(0.99, abs=0.011)
    assert timedelta(0) <= later.mission.start_at - later_at < timedelta(seconds=1)
    await world.end()


class SlowSolver(SolverPool):
    """Takes this much fleet time for each plan."""

    clock: ManualClock
    takes = timedelta(0)

    async def compose(self, problem: Problem, **options: Any) -> Plan:
        self.clock.advance(self.takes)
        return await super().compose(problem, **options)


class RareLooks:
    """Looks at the calendars every 45 minutes, as if those of many other drones came between."""

    def __init__(self, world: BusyWorld) -> None:
        self._calendars = world.calendars
        self._clock = world.clock
        self._next_at = world.clock.now()

    async def step(self) -> bool:
        if self._clock.now() >= self._next_at:
            await self._calendars.step()
            self._next_at = self._clock.now() + timedelta(minutes=45)
        return False


class UnkeptCalendars:
    """No mission is sent after the one before it."""

    async def step(self) -> bool:
        return False


@pytest.mark.parametrize(
    ("minutes_per_plan", "looks_rarely"), [(1, False), (7, True)], ids=["slow", "slow and rare"]
)
@pytest.mark.long
async def test_missions_are_sent_though_planning_them_again_takes_long(
    migrated_url: str, minutes_per_plan: int, looks_rarely: bool
) -> None:
    """Planning a queue anew can take longer than the usual margin until its next mission begins."""
    async with BusyWorld(migrated_url) as world:
        solver = SlowSolver(threads=1, time_limit_s=5.0)
        solver.clock = world.clock
        world.solver = solver
        world.restart()
        async with solver:
            await book_chain(world)
            world.calendars = UnkeptCalendars()  # type: ignore[assignment]
            await pass_minutes(world, 300)
            assert len(await waiting(world)) == 4
            world.restart()
            solver.takes = timedelta(minutes=minutes_per_plan)
            if looks_rarely:
                world.calendars = RareLooks(world)  # type: ignore[assignment]

            await world.end()

    assert delivered_by(world) == [*CHAIN]
