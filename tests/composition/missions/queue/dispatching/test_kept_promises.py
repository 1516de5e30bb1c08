"""Shared missions are planned again and read again: promises, places and notes are kept."""

import json
from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.missions.booking.book import SharedTrip
from skyway_composition.missions.queue.dispatching.adopt import JoinedTrip
from skyway_composition.tables import missions
from sqlalchemy import update

from tests.composition.busy_world import BusyWorld
from tests.composition.missions.queue.dispatching.shared_requests import asks, finder_of
from tests.composition.missions.queue.dispatching.test_shared_trips import (
    arrivals,
    book,
    book_both,
    shared_mission,
)

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def test_a_host_that_cancels_leaves_the_promise_of_each_package_of_its_guest(
    world: BusyWorld,
) -> None:
    """Alone, the guest's packages could be delivered a little sooner in the other order."""
    await book_both(world)
    promised = await arrivals(world)

    await world.cancel("dlv1", None)
    await world.keep_calendars()
    await world.check()

    now = await arrivals(world)
    assert {each for each, _ in now} == {"dlv2"}
    assert all(at <= promised[each] + timedelta(seconds=60) for each, at in now.items())


async def test_a_host_keeps_its_first_promise_when_another_delivery_joins(
    world: BusyWorld,
) -> None:
    await book(world, "dlv1", asks("b"))
    (alone,) = await world.planned()

    await book(world, "dlv2", asks("b", "c"))

    host, guest = (await shared_mission(world)).shares
    promised = {each.package_id: each.eta_at for each in (await shared_mission(world)).promised}
    assert {*promised} == {*host.packages, *guest.packages}
    assert all(promised[each.package_id] == each.eta_at for each in alone.promised)


async def test_a_mission_that_waits_for_its_packages_begins_where_its_drone_is_then(
    world: BusyWorld,
) -> None:
    """The drone flies home after the mission before, because the next one begins much later."""
    later_at = world.clock.now() + timedelta(seconds=2_000)
    await book(world, "dlv1", asks("b", wait_s=970.0, may_be_later_s=1_800.0))
    await book(world, "dlv2", asks("b", wait_s=700.0))
    await world.cancel("dlv1", None)
    await book(world, "dlv3", asks("c", wait_s=0.0, earliest_pickup_at=later_at))

    await world.end()

    assert await world.handed_over() == [("dlv2", "p1"), ("dlv3", "p1")]


async def test_what_a_later_version_notes_about_a_guest_is_ignored(world: BusyWorld) -> None:
    record = await book_both(world)
    host, guest = (each.model_dump(mode="json") for each in record.shares)
    near = {"asked_station_id": "b", "within_m": 9.0, "away_m": 8.0, "of_later": 1}
    later = json.dumps([host, {**guest, "near": near, "of_later": 1}])
    async with world.db.write() as tx:
        await tx.execute(update(missions).values(shares=later))

    assert (await shared_mission(world)).shares[1].near is not None
    await world.check()


async def test_a_request_flies_alone_if_the_shared_trip_should_have_begun_before_it_is_saved(
    world: BusyWorld,
) -> None:
    await book(world, "dlv1", asks("b"))
    found = finder_of(world)

    class Slow:
        """Finds a shared trip so slowly that the trip should have begun meanwhile."""

        async def find(self, *asked: Any) -> SharedTrip | None:
            joint = await found.find(*asked)
            if isinstance(joint, JoinedTrip):
                late_ms = 1_000 + joint.better.first_start_ms - world.now_ms
                world.clock.advance(timedelta(milliseconds=late_ms))
            return joint

    world.bookings = replace(world.bookings, shared=Slow())
    before = world.clock.now()
    await book(world, "dlv2", asks("b", "c"))

    assert world.clock.now() > before
    assert all(each.shares == () for each in await world.planned())
