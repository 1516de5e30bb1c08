"""The standby of one drone gives way to the service of another drone that needs its pad."""

from collections.abc import AsyncIterator
from dataclasses import replace
from datetime import datetime, timedelta

import pytest
from skyway_composition.missions.booking.standby_store import unanswered

from skyway.ids import MissionId, StationId
from tests.composition.busy_world import BusyWorld
from tests.composition.missions.queue.booked_chain import (
    book,
    delivered_by,
    etas,
    kinds_of,
    pass_minutes,
)

pytestmark = pytest.mark.databases("sqlite")


@pytest.fixture
def package() -> str:
    return "skyway_composition"


@pytest.fixture
async def world(migrated_url: str) -> AsyncIterator[BusyWorld]:
    """A world whose only pad is at a, the home of drones 1 and 2."""
    async with BusyWorld(migrated_url) as world:
        for station_id in "bc":
            await world.close("PAD", station_id=StationId(station_id), pad=0, reason="no power")
        yield world


async def come_home(world: BusyWorld, *, minutes: float = 45) -> None:
    """Both drones deliver and come home; drone 1 charges, and drone 2 waits for the pad."""
    assert await book(world, "first", "a", "b", drone=1) == "BOOKED"
    assert await book(world, "second", "a", "c", drone=2) == "BOOKED"
    await pass_minutes(world, minutes)


async def charges_until(world: BusyWorld, drone: int) -> datetime:
    """The planned end of the standby of a drone with one mission."""
    drone_id = world.drones[drone - 1].drone_id
    [record] = [each for each in await world.planned() if each.drone_id == drone_id]
    return record.mission.released_at


async def test_a_delivery_does_not_wait_for_the_charge_of_another_drone(world: BusyWorld) -> None:
    await come_home(world)
    charged_at = await charges_until(world, 1)

    assert await book(world, "third", "a", "b", drone=2) == "BOOKED"

    await world.check()
    assert (await etas(world))["third"] < charged_at
    assert (await kinds_of(world, "first"))["REPLANNED"] == 0
    await world.end()
    assert delivered_by(world, 2) == ["second", "third"]
    assert world.drones[0].logbook.soc > 0.99


async def test_a_drone_that_does_not_answer_keeps_its_pad(world: BusyWorld) -> None:
    await come_home(world)
    charged_at = await charges_until(world, 1)
    world.drones[0].is_held_back = True

    assert await book(world, "third", "a", "b", drone=2) == "BOOKED"

    assert (await etas(world))["third"] > charged_at
    await world.check()
    world.drones[0].is_held_back = False
    await world.end()
    assert delivered_by(world, 2) == ["second", "third"]


async def test_only_the_drone_that_was_asked_has_not_answered(world: BusyWorld) -> None:
    await come_home(world)
    world.drones[0].is_held_back = True
    assert await book(world, "third", "a", "b", drone=2) == "BOOKED"
    mission_of = {each.drone_id: each.mission_id for each in await world.live()}
    asked, other = (mission_of[drone.drone_id] for drone in world.drones[:2])

    async def is_unanswered(mission_id: MissionId) -> bool:
        async with world.db.read() as connection:
            return await unanswered(connection, [mission_id])

    before = [await is_unanswered(each) for each in (asked, other)]
    world.drones[0].is_held_back = False
    await world.converse()

    assert before == [True, False]
    assert not await is_unanswered(asked)


@pytest.mark.long
async def test_a_drone_that_refuses_keeps_its_pad(world: BusyWorld) -> None:
    await come_home(world)
    charged_at = await charges_until(world, 1)
    world.drones[0].refuses_next = True

    assert await book(world, "third", "a", "b", drone=2) == "BOOKED"

    assert (await etas(world))["third"] > charged_at
    await world.check()
    await world.end()


@pytest.mark.long
async def test_an_offline_drone_is_not_asked(world: BusyWorld) -> None:
    await come_home(world)
    world.drones[0].set_reception(False)
    await world.converse()

    assert await book(world, "third", "a", "b", drone=2) == "BOOKED"

    assert [each.proposal for each in await world.live()] == [None, None]
    await world.end()


@pytest.mark.long
async def test_a_drone_is_asked_before_its_own_service_is_over(world: BusyWorld) -> None:
    await come_home(world, minutes=5)
    promised = (await etas(world))["first"]
    charged_at = await charges_until(world, 1)

    assert await book(world, "third", "a", "b", drone=2) == "BOOKED"

    await world.check()
    assert (await etas(world))["third"] < charged_at
    assert (await etas(world))["first"] == promised
    await world.end()
    assert delivered_by(world, 1) == ["first"]
    assert (await kinds_of(world, "first"))["REPLANNED"] == 0
    assert world.drones[0].logbook.soc > 0.99


async def test_the_standby_of_a_queued_mission_gives_way_in_the_booking(world: BusyWorld) -> None:
    at = world.clock.now() + timedelta(hours=1)
    assert await book(world, "later", "a", "b", drone=1, earliest_pickup_at=at) == "BOOKED"
    assert await book(world, "second", "a", "c", drone=2) == "BOOKED"
    await pass_minutes(world, 40)
    promised, charged_at = (await etas(world))["later"], await charges_until(world, 1)

    assert await book(world, "third", "a", "b", drone=2) == "BOOKED"

    await world.check()
    assert (await etas(world))["third"] < charged_at
    assert (await etas(world))["later"] == promised
    await world.end()
    assert delivered_by(world, 1) == ["later"]
    assert world.drones[0].logbook.soc > 0.99


async def test_nobody_gives_way_when_the_delivery_comes_no_sooner(world: BusyWorld) -> None:
    assert await book(world, "first", "a", "b", drone=1) == "BOOKED"
    await pass_minutes(world, 45)
    charged_at = await charges_until(world, 1)

    assert await book(world, "second", "a", "c", drone=2) == "BOOKED"

    assert await charges_until(world, 1) == charged_at


async def test_a_request_that_only_a_standby_prevents_is_booked(world: BusyWorld) -> None:
    await come_home(world)
    qos = {"deadline_at": await charges_until(world, 1)}

    assert await book(world, "third", "a", "b", drone=2, qos=qos) == "BOOKED"

    await world.check()
    await world.end()
    assert delivered_by(world, 2) == ["second", "third"]


class Killed(Exception):
    """Composition is killed."""


@pytest.mark.long
async def test_a_kill_after_a_drone_was_asked_leaves_only_a_later_charge(
    world: BusyWorld,
) -> None:
    await come_home(world)

    async def kill(_wall_s: float) -> None:
        await world.converse()
        raise Killed

    world.bookings = replace(world.bookings, pause=kill)
    with pytest.raises(Killed):
        await book(world, "third", "a", "b", drone=2)
    world.restart()

    await world.converse()
    await world.check()
    assert "third" not in await etas(world)
    await world.end()
    assert world.drones[0].logbook.soc > 0.99


async def test_a_standby_does_not_give_way_to_another_standby(world: BusyWorld) -> None:
    assert await book(world, "first", "a", "b", drone=1) == "BOOKED"
    await pass_minutes(world, 5)
    charged_at = await charges_until(world, 1)

    assert await book(world, "second", "a", "c", drone=2) == "BOOKED"

    assert await charges_until(world, 1) == charged_at
    assert await charges_until(world, 2) > charged_at


@pytest.mark.databases("postgresql")
async def test_two_services_share_a_pad_before_any_standby(world: BusyWorld) -> None:
    await come_home(world)
    assert await book(world, "third", "a", "b", drone=2) == "BOOKED"
    await world.check()

    assert await book(world, "fourth", "a", "c", drone=1) == "BOOKED"

    await world.check()
    await world.end()
    assert delivered_by(world, 1) == ["first", "fourth"]
    assert delivered_by(world, 2) == ["second", "third"]
