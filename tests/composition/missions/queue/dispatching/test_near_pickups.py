"""A customer hands packages over at another station, so that they share the trip from there."""

import json
from collections.abc import AsyncIterator
from dataclasses import replace
from datetime import timedelta
from typing import Any, Final

import pytest
from skyway_composition.missions.booking.book import SharedTrip
from skyway_composition.missions.mission.custody_store import held_packages
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.share import shares_json
from skyway_composition.missions.mission.share_views import mission_for
from skyway_composition.missions.queue.store import hosts_at

from skyway.contracts.mission import Mission
from skyway.delivery.request import DeliveryRequest, Place
from skyway.geo import Position, distance_m
from skyway.ids import DeliveryId, StationId
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from tests.composition.busy_network import NETWORK_ID, PLACES, SEGMENTS, add_network
from tests.composition.busy_world import BusyWorld
from tests.composition.dispatched_world import PROVIDER, dispatcher_of
from tests.composition.left_packages import left_to_book
from tests.composition.missions.queue.booked_chain import kinds_of, pass_minutes
from tests.composition.missions.queue.dispatching.shared_requests import asks, finder_of

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

#: The stations of a busy world, and one that is 1 km from a.
_PLACES: Final = {**PLACES, "d": Position(0.0, -0.009)}
_SEGMENTS: Final = (*SEGMENTS, "ad", "bd", "cd")
_AWAY_M: Final = distance_m(_PLACES["a"], _PLACES["d"])


class NearWorld(BusyWorld):
    """A busy world with a station near a."""

    async def add_network(self, tx: Tx) -> None:
        await add_network(tx, now_ms=self.now_ms, places=_PLACES, segments=_SEGMENTS)


@pytest.fixture
async def world(migrated_url: str) -> AsyncIterator[NearWorld]:
    async with NearWorld(migrated_url) as world:
        yield world


async def book(
    world: BusyWorld, delivery_id: str, request: DeliveryRequest, *, drone: int | None = None
) -> None:
    """Book one of the drones, or this one."""
    waiting = request.begun_after_wait(world.clock.now())
    drones = None if drone is None else world.drones[drone - 1 : drone]
    booked = await world.book(
        delivery_id,
        waiting,
        loading="AUTOMATIC",
        drones=drones,
        ready_at=request.earliest_pickup_at,
    )
    assert booked == "BOOKED"
    await world.keep_calendars()


async def mission_of(world: BusyWorld, delivery_id: str) -> tuple[MissionRecord, Mission]:
    """The mission that flies for a delivery, and the mission that the delivery sees."""
    found = [(one, mission_for(one, DeliveryId(delivery_id))) for one in await world.planned()]
    (mission,) = [each for each in found if each[1].delivery_id == delivery_id]
    return mission


async def meet_at_a(world: BusyWorld, **members: Any) -> MissionRecord:
    """Two deliveries that share the trip of the first one from a; the second asks from d."""
    await book(world, "dlv1", asks("b"))
    await book(world, "dlv2", asks("b", "c", pickup="d", within_m=1_200.0, **members))
    await world.check()
    record, _ = await mission_of(world, "dlv2")
    assert [each.delivery_id for each in record.shares] == ["dlv1", "dlv2"]
    return record


async def test_a_guest_hands_its_packages_over_where_its_host_is_loaded(world: NearWorld) -> None:
    asked_ms = world.now_ms
    record = await meet_at_a(world)

    host, guest = (mission_for(record, DeliveryId(each)) for each in ("dlv1", "dlv2"))
    assert (host.pickup_station_id, host.pickup_away_m) == ("a", 0.0)
    assert (guest.pickup_station_id, guest.pickup_away_m) == ("a", _AWAY_M)
    # A share has these fields only where they are needed.
    stored = json.loads(shares_json(record.shares) or "")
    assert ["near" in each for each in stored] == [False, True]
    assert ["delay" in each for each in stored] == [False, False]
    # The customer has a second for each metre of the way there.
    assert moment_to_ms(guest.start_at) - asked_ms >= 1000 * _AWAY_M
    async with world.db.read() as connection:
        held = await held_packages(connection, DeliveryId("dlv2"))
    assert {each.custodian.custodian_id for each in held.values()} == {"a"}

    await world.end()
    assert sorted(await world.handed_over()) == [("dlv1", "p1"), ("dlv2", "p1"), ("dlv2", "p2")]


@pytest.mark.parametrize(
    ("host", "guest"),
    [
        (asks("b"), asks("b", pickup="d", within_m=900.0)),
        (asks("b", wait_s=900.0), asks("b", pickup="d", within_m=1_200.0)),
        (asks("b"), asks("a", pickup="d", within_m=1_200.0)),
    ],
    ids=["too far", "too soon", "it is the destination"],
)
async def test_a_request_keeps_its_own_pickup_when_no_other_pickup_fits(
    world: NearWorld, host: DeliveryRequest, guest: DeliveryRequest
) -> None:
    await book(world, "dlv1", host)
    await book(world, "dlv2", guest)

    record, mission = await mission_of(world, "dlv2")
    assert record.shares == ()
    assert (mission.pickup_station_id, mission.pickup_away_m) == ("d", 0.0)


@pytest.mark.parametrize(
    ("wait_s", "may_be_later_s"), [(960.0, 0.0), (600.0, 900.0)], ids=["tolerance", "allowed"]
)
async def test_a_host_waits_for_packages_from_another_station_if_its_promise_allows_that(
    world: NearWorld, wait_s: float, may_be_later_s: float
) -> None:
    await book(world, "dlv1", asks("b", wait_s=wait_s, may_be_later_s=may_be_later_s))
    alone, _ = await mission_of(world, "dlv1")
    asked_ms = world.now_ms
    await book(world, "dlv2", asks("b", pickup="d", within_m=1_200.0))
    await world.check()

    record, _ = await mission_of(world, "dlv2")
    assert [each.delivery_id for each in record.shares] == ["dlv1", "dlv2"]
    assert alone.start.at_ms < asked_ms + 1000 * _AWAY_M <= record.start.at_ms
    later = record.mission.packages[0].eta_at - alone.mission.packages[0].eta_at
    assert later.total_seconds() <= max(60.0, may_be_later_s)

    await world.cancel("dlv2", None)
    await world.keep_calendars()
    again, _ = await mission_of(world, "dlv1")
    assert again.start.at_ms <= alone.start.at_ms
    await world.end()
    assert await world.handed_over() == [("dlv1", "p1")]


async def test_a_guest_that_cancels_lets_its_host_begin_as_early_as_alone(
    world: NearWorld,
) -> None:
    await book(world, "dlv1", asks("b", may_be_later_s=1800.0))
    alone, _ = await mission_of(world, "dlv1")
    later_at = alone.mission.start_at + timedelta(minutes=10)
    await book(world, "dlv2", asks("b", earliest_pickup_at=later_at, wait_s=0.0))
    together, _ = await mission_of(world, "dlv2")
    assert [each.delivery_id for each in together.shares] == ["dlv1", "dlv2"]
    assert together.mission.start_at >= later_at

    await world.cancel("dlv2", None)
    await world.keep_calendars()
    await world.check()

    again, _ = await mission_of(world, "dlv1")
    assert again.mission.start_at <= alone.mission.start_at
    assert again.mission.packages[0].eta_at <= alone.mission.packages[0].eta_at


async def test_a_request_prefers_the_host_at_its_own_pickup_when_it_delivers_sooner(
    world: NearWorld,
) -> None:
    await book(world, "dlv1", asks("b"))
    await book(world, "dlv2", asks("b", wait_s=300.0, pickup="d"))
    await book(world, "dlv3", asks("b", pickup="d", within_m=1_200.0, qos=_FAST))

    _, mission = await mission_of(world, "dlv3")
    assert mission.pickup_station_id == "d"


async def test_hosts_at_the_own_pickup_are_compared_before_those_at_other_stations(
    world: NearWorld,
) -> None:
    await book(world, "dlv1", asks("b"))
    await book(world, "dlv2", asks("b", pickup="d", wait_s=1800.0))

    async with world.db.read() as connection:
        ready_ms = {StationId("a"): 1, StationId("d"): 0}
        (host,) = await hosts_at(connection, NETWORK_ID, ready_ms, provider_ids=[PROVIDER], limit=1)

    assert host.mission.delivery_id == "dlv2"


_FAST: Final = {
    "objective": "FASTEST",
    "pooling": True,
    "pooling_wait_s": 1200.0,
    "pickup_within_m": 1_200.0,
}


async def test_the_dispatcher_moves_no_pickup_and_waits_for_the_packages(
    world: NearWorld,
) -> None:
    """The host could begin as soon as a drone is free, but its guest is still on the way."""
    await book(world, "dlv0", asks("b", "c", wait_s=0.0, qos={}), drone=1)
    await book(world, "dlv1", asks("b", wait_s=0.0), drone=1)
    asked_ms = world.now_ms
    await book(world, "dlv2", asks("b", pickup="d", within_m=1_200.0, mass_kg=0.001), drone=1)
    await book(world, "dlv3", asks("b", pickup="d", wait_s=1300.0), drone=2)

    await dispatcher_of(world).look_at(NETWORK_ID, PROVIDER)
    await world.check()

    found = {each: await mission_of(world, each) for each in ("dlv1", "dlv2", "dlv3")}
    pickups = {each: mission.pickup_station_id for each, (_, mission) in found.items()}
    assert pickups == {"dlv1": "a", "dlv2": "a", "dlv3": "d"}
    shared, _ = found["dlv2"]
    assert shared.allowed_from_ms - asked_ms >= 1000 * _AWAY_M


@pytest.mark.long
async def test_a_guest_that_loses_its_host_is_booked_from_the_same_station(
    world: NearWorld,
) -> None:
    record = await meet_at_a(world)
    drone = next(each for each in world.drones if each.drone_id == record.drone_id)
    drone.refuses_next = True
    while not (await kinds_of(world, "dlv2"))["REFUSED"]:
        await pass_minutes(world, 1)

    for delivery_id in ("dlv1", "dlv2"):
        left = await left_to_book(world, delivery_id)
        assert left is not None
        # The gateway asks from where the packages are.
        left = left.model_copy(update={"pickup": Place(station_id=StationId("a"))})
        assert await world.book(delivery_id, left, loading="AUTOMATIC") == "BOOKED"
    await world.check()
    _, mission = await mission_of(world, "dlv2")
    assert (mission.pickup_station_id, mission.attempt) == ("a", 2)
    await world.end()


async def test_a_guest_stays_where_it_is_when_its_host_cancels(world: NearWorld) -> None:
    await meet_at_a(world)

    await world.cancel("dlv1", None)
    await world.keep_calendars()
    await world.check()

    _, mission = await mission_of(world, "dlv2")
    assert mission.pickup_station_id == "a"
    await world.cancel("dlv2", ("p2",))
    await world.end()
    assert await world.handed_over() == [("dlv2", "p1")]


@pytest.mark.parametrize("change", ["closed", "removed"])
async def test_a_request_flies_alone_if_the_other_station_is_gone_when_it_is_booked(
    world: NearWorld, change: str
) -> None:
    await book(world, "dlv1", asks("b"))
    found = finder_of(world)
    joints: list[SharedTrip | None] = []

    class Interrupted:
        """Finds a shared trip; then the host's station leaves, before the request can join."""

        async def find(self, *asked: Any) -> SharedTrip | None:
            joint = await found.find(*asked)
            joints.append(joint)
            if len(joints) > 1:
                return joint
            if change == "closed":
                await world.close("STATION", station_id=StationId("a"), reason="roof works")
            else:
                places = {name: each for name, each in _PLACES.items() if name != "a"}
                async with world.db.write() as tx:
                    await add_network(
                        tx,
                        now_ms=world.now_ms,
                        places=places,
                        segments=("bc", "bd", "cd"),
                        version=2,
                    )
            return joint

    world.bookings = replace(world.bookings, shared=Interrupted())
    request = asks("b", pickup="d", within_m=1_200.0).begun_after_wait(world.clock.now())
    await world.book("dlv2", request, loading="AUTOMATIC", drones=world.drones[2:])

    assert joints[0] is not None
    _, mission = await mission_of(world, "dlv2")
    assert mission.pickup_station_id == "d"
