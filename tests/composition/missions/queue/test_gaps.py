"""Missions in the gaps of a drone's calendar: the time before a mission for later stays free."""

from datetime import datetime, timedelta

import pytest

from skyway.ids import StationId
from tests.composition.busy_world import BusyWorld
from tests.composition.missions.queue.booked_chain import (
    book,
    delivered_by,
    etas,
    kinds_of,
    pass_minutes,
    waiting,
)

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


def later_today(world: BusyWorld, hour: int) -> datetime:
    return world.clock.now().replace(hour=hour, minute=0, second=0, microsecond=0)


async def book_for_later(world: BusyWorld, delivery_id: str = "later", hour: int = 18) -> None:
    """Book a mission of the first drone that begins where it stands now, hours later."""
    at = later_today(world, hour)
    assert await book(world, delivery_id, "b", "c", earliest_pickup_at=at) == "BOOKED"


async def test_a_mission_for_later_is_not_sent_to_its_idle_drone(world: BusyWorld) -> None:
    await book_for_later(world)

    await pass_minutes(world, 30)

    assert await waiting(world) == ["later"]
    assert world.drones[0].logbook.station_id == "a"
    await world.end()
    assert delivered_by(world) == ["later"]


async def test_a_drone_delivers_before_the_mission_that_waits_for_later(world: BusyWorld) -> None:
    await book_for_later(world)
    promised = (await etas(world))["later"]

    assert await book(world, "now", "b", "c") == "BOOKED"

    assert await waiting(world) == ["later"]
    assert (await etas(world))["now"] < later_today(world, 18)
    await world.end()
    assert delivered_by(world) == ["now", "later"]
    assert (await kinds_of(world, "later"))["REPLANNED"] == 0
    assert (await kinds_of(world, "later"))["RETIMED"] == 0
    assert promised > later_today(world, 18)


async def test_a_gap_between_two_waiting_missions_is_used(world: BusyWorld) -> None:
    await book_for_later(world, "evening", 23)
    await book_for_later(world, "noon", 15)
    assert await waiting(world) == ["noon", "evening"]

    at = later_today(world, 19)
    assert await book(world, "afternoon", "c", "b", earliest_pickup_at=at) == "BOOKED"

    assert await waiting(world) == ["noon", "afternoon", "evening"]
    await world.check()
    await world.end()
    assert delivered_by(world) == ["noon", "afternoon", "evening"]
    assert (await kinds_of(world, "evening"))["REPLANNED"] == 0


async def test_a_mission_that_does_not_fit_before_another_one_comes_after_it(
    world: BusyWorld,
) -> None:
    await book_for_later(world, "later", 18)
    at = later_today(world, 18) - timedelta(minutes=60)

    assert await book(world, "close", "b", "c", earliest_pickup_at=at) == "BOOKED"

    assert await waiting(world) == ["later", "close"]
    await world.end()
    assert delivered_by(world) == ["later", "close"]


async def test_a_drone_flies_home_when_the_mission_after_a_gap_is_cancelled(
    world: BusyWorld,
) -> None:
    await book_for_later(world)
    assert await book(world, "now", "b", "c") == "BOOKED"

    await world.cancel("later", None)

    await world.end()
    assert delivered_by(world) == ["now"]
    assert world.drones[0].logbook.station_id == "a"


@pytest.mark.long
async def test_a_waiting_mission_keeps_its_time_when_the_mission_before_it_is_cancelled(
    world: BusyWorld,
) -> None:
    await book_for_later(world)
    assert await book(world, "now", "b", "c") == "BOOKED"
    promised = (await etas(world))["later"]

    await world.cancel("now", None)
    await pass_minutes(world, 60)

    assert abs((await etas(world))["later"] - promised) < timedelta(seconds=2)
    await world.end()
    assert delivered_by(world) == ["later"]


class UnkeptCalendars:
    """No mission is sent while these are in place."""

    async def step(self) -> bool:
        return False


@pytest.mark.long
async def test_a_late_mission_before_another_one_is_not_flown_after_its_deadline(
    world: BusyWorld,
) -> None:
    await book_for_later(world, "evening", 23)
    at = later_today(world, 15)
    qos = {"deadline_at": at + timedelta(minutes=40)}
    assert await book(world, "noon", "b", "c", earliest_pickup_at=at, qos=qos) == "BOOKED"
    calendars = world.calendars
    world.calendars = UnkeptCalendars()  # type: ignore[assignment]
    await world.pass_time(at + timedelta(minutes=35) - world.clock.now())

    world.calendars = calendars
    await world.keep_calendars()

    assert (await kinds_of(world, "noon"))["REFUSED"] == 1
    await world.end()
    assert delivered_by(world) == ["evening"]


@pytest.mark.long
async def test_a_waiting_mission_may_charge_on_the_pad_of_the_one_before_it(
    world: BusyWorld,
) -> None:
    for station_id in "bc":
        await world.close("PAD", station_id=StationId(station_id), pad=0, reason="no power")
    at = later_today(world, 15)
    assert await book(world, "noon", "a", "c", earliest_pickup_at=at) == "BOOKED"
    soon_after = at + timedelta(minutes=30)

    assert await book(world, "next", "b", "a", earliest_pickup_at=soon_after) == "BOOKED"

    assert await waiting(world) == ["noon", "next"]
    await world.check()
    await world.end()
    assert delivered_by(world) == ["noon", "next"]
