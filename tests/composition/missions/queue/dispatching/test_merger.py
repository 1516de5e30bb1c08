"""The dispatcher makes one shared trip of missions that wait, and no customer loses by it."""

import asyncio
from dataclasses import replace
from datetime import timedelta

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.share_views import missions_seen
from skyway_composition.missions.queue.dispatching.merger import (
    MOST_SHARES,
    Guest,
    carrying,
    share_of,
)
from skyway_composition.tables import missions
from sqlalchemy import select

from skyway.delivery.request import DeliveryRequest
from skyway.runtime.metrics import COUNTERS
from tests.composition.busy_world import BusyWorld
from tests.composition.dispatched_world import (
    adopt_after_kills,
    better_order,
    dispatch_fairly,
    dispatcher_of,
)
from tests.composition.left_packages import left_to_book
from tests.composition.missions.queue.booked_chain import (
    kinds_of,
    pass_minutes,
    reports_of,
)
from tests.composition.missions.queue.dispatching.shared_requests import asks, packages_named

_on_sqlite = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

_BOTH = [("dlv1", "p1"), ("dlv2", "p1"), ("dlv2", "p2")]


async def asked_alone(
    world: BusyWorld, delivery_id: str, request: DeliveryRequest, *, drone: int
) -> str:
    """Ask for a mission of its own on this drone, as with an accepted offer; the outcome."""
    world.bookings = replace(world.bookings, shared=None)
    outcome = await world.book(
        delivery_id,
        request.begun_after_wait(world.clock.now()),
        loading="AUTOMATIC",
        drones=world.drones[drone - 1 : drone],
    )
    await world.keep_calendars()
    return outcome


async def book_alone(
    world: BusyWorld, delivery_id: str, request: DeliveryRequest, *, drone: int = 1
) -> None:
    """Book a mission of its own on this drone."""
    assert await asked_alone(world, delivery_id, request, drone=drone) == "BOOKED"


async def book_two(
    world: BusyWorld, *, first: str = "b", second: tuple[str, ...] = ("b", "b"), drone: int = 1
) -> None:
    """Two missions from one station wait, the second one for this drone."""
    await book_alone(world, "dlv1", asks(first))
    await book_alone(world, "dlv2", asks(*second), drone=drone)


async def merged(world: BusyWorld) -> MissionRecord:
    """The only mission after the dispatcher has made one of the two."""
    outcomes = await dispatch_fairly(world)
    assert outcomes[0] == "adopted"
    (record,) = await world.planned()
    assert {each.delivery_id for each in record.shares} == {"dlv1", "dlv2"}
    return record


async def test_two_waiting_missions_become_one_trip_at_the_pooled_price(world: BusyWorld) -> None:
    await book_two(world)
    before = {each.mission.delivery_id: each.mission for each in await world.planned()}

    record = await merged(world)

    seen = {each.delivery_id: each for each in missions_seen(record)}
    assert {each.mission_id for each in seen.values()} == {
        each.mission_id for each in before.values()
    }
    for delivery_id, mission in seen.items():
        alone = before[delivery_id]
        assert mission.price == alone.price
        assert [each.package_id for each in mission.packages] == [
            each.package_id for each in alone.packages
        ]
        shifts = [
            abs(new.eta_at - old.eta_at)
            for new, old in zip(mission.packages, alone.packages, strict=True)
        ]
        kinds = await kinds_of(world, delivery_id)
        assert kinds["REPLANNED"] == (max(shifts) > timedelta(minutes=2))
    own = {"dlv1": {"p1"}, "dlv2": {"p1", "p2"}}
    await world.end()
    for share in record.shares:
        reports = await reports_of(world, share.delivery_id)
        assert packages_named(reports) == own[share.delivery_id]
        assert {each.mission_id for each in reports} == {share.mission_id}
        (loaded,) = [each for each in reports if each.kind == "LOADED"]
        assert loaded.mission is not None
        assert loaded.mission.is_pooled
        assert loaded.mission.price == share.pooled_price
        assert share.pooled_price.amount < share.price.amount
    assert sorted(await world.handed_over()) == _BOTH


@_on_sqlite
async def test_two_flights_to_one_place_at_one_time_become_one(world: BusyWorld) -> None:
    await book_two(world, second=("b",), drone=2)
    await merged(world)


@_on_sqlite
@pytest.mark.parametrize(("first", "second"), [("b", "c"), ("c", "b")])
async def test_two_missions_merge_although_the_drone_charges_between_their_stops(
    world: BusyWorld, first: str, second: str
) -> None:
    """Another order of the stops, or a sooner recharge, would break the promise of the first."""
    await book_two(world, first=first, second=(second,))

    record = await merged(world)
    kinds = [each.kind for each in record.mission.plan.steps]
    assert "RECHARGE" in kinds[kinds.index("DELIVER") :]
    await world.end()


@_on_sqlite
async def test_the_customer_of_the_mission_that_ends_learns_of_its_new_drone_and_time(
    world: BusyWorld,
) -> None:
    await book_alone(world, "dlv0", asks("c", wait_s=0.0, qos={}), drone=2)
    await book_alone(world, "dlv1", asks("b"))
    await book_alone(world, "dlv2", asks("b", "b", wait_s=0.0), drone=2)
    (gone,) = [each for each in await world.planned() if each.mission.delivery_id == "dlv2"]
    assert gone.drone_id == "drn_2"
    counted = COUNTERS.value("skyway_shared_trips")

    assert (await dispatch_fairly(world))[0] == "adopted"

    (record,) = [each for each in await world.planned() if each.shares]
    (report,) = [each for each in await reports_of(world, "dlv2") if each.kind == "REPLANNED"]
    assert report.mission is not None
    assert (report.mission_id, report.drone_id) == (gone.mission_id, record.drone_id)
    assert report.mission.drone_id == record.drone_id
    assert max(each.eta_at for each in report.etas) < max(
        each.eta_at for each in gone.mission.packages
    )
    # The registry counts the mission's drone as free of it.
    last = [each for each in await world.reports("registry") if each.mission_id == gone.mission_id][
        -1
    ]
    assert (last.kind, last.mission_state, last.drone_id) == ("ENDED", "CANCELLED", "drn_2")
    assert last.seq == report.seq
    assert COUNTERS.value("skyway_shared_trips") == counted + 1
    async with world.db.read() as connection:
        found = await connection.execute(select(missions.c.mission_id))
    assert gone.mission_id not in set(found.scalars())
    await world.end()
    assert sorted(await world.handed_over()) == [("dlv0", "p1"), *_BOTH]


@pytest.mark.databases("postgresql")
async def test_a_merge_that_is_killed_anywhere_changes_nothing(world: BusyWorld) -> None:
    """On PostgreSQL, where each statement is a wait."""
    await book_two(world)
    dispatcher = dispatcher_of(world)
    better = await better_order(dispatcher)
    assert better.merges

    await adopt_after_kills(world, dispatcher, better)

    await world.end()
    assert sorted(await world.handed_over()) == _BOTH


@_on_sqlite
@pytest.mark.parametrize(("leaves", "stays"), [("dlv1", "dlv2"), ("dlv2", "dlv1")])
async def test_a_delivery_whose_companion_cancels_flies_on_at_its_full_price(
    world: BusyWorld, leaves: str, stays: str
) -> None:
    await book_two(world)
    await merged(world)

    await world.cancel(leaves, None)
    await world.keep_calendars()
    await world.check()
    await world.end()

    assert {of for of, _ in await world.handed_over()} == {stays}
    (loaded,) = [each for each in await reports_of(world, stays) if each.kind == "LOADED"]
    assert loaded.mission is None


@_on_sqlite
async def test_a_cancellation_before_the_adoption_wins(world: BusyWorld) -> None:
    await book_two(world)
    dispatcher = dispatcher_of(world)
    better = await better_order(dispatcher)

    await world.cancel("dlv2", None)

    assert await dispatcher.adopt(better) == "outdated"
    await world.check()
    await world.end()
    assert await world.handed_over() == [("dlv1", "p1")]


@_on_sqlite
async def test_both_deliveries_are_booked_again_when_the_drone_refuses_their_trip(
    world: BusyWorld,
) -> None:
    await book_two(world)
    record = await merged(world)
    drone = next(each for each in world.drones if each.drone_id == record.drone_id)
    drone.refuses_next = True
    while not (await kinds_of(world, "dlv2"))["REFUSED"]:
        await pass_minutes(world, 1)

    for delivery_id in ("dlv1", "dlv2"):
        assert (await kinds_of(world, delivery_id))["REFUSED"] == 1
        left = await left_to_book(world, delivery_id)
        assert left is not None
        assert await world.book(delivery_id, left, loading="AUTOMATIC") == "BOOKED"
    # A drone that refused a delivery must not get it again with another mission.
    await dispatch_fairly(world)
    assert all(len(each.shares) < 2 for each in await world.planned())
    await world.end()
    assert sorted(await world.handed_over()) == _BOTH


@_on_sqlite
@pytest.mark.parametrize(
    "second",
    [
        asks("b", qos={"objective": "CHEAPEST"}),
        asks("b", latest_pickup_at="2026-03-03T12:00:00Z"),
        asks("b", qos={"pooling": True, "priority": "PRIORITY"}),
        asks("b", mass_kg=3.0),
        asks("b", wait_s=3600.0, earliest_pickup_at="2026-03-01T20:00:00Z"),
    ],
    ids=["no pooling", "a window", "another class", "too heavy together", "not there yet"],
)
async def test_missions_that_cannot_share_a_trip_stay_apart(
    world: BusyWorld, second: DeliveryRequest
) -> None:
    await book_alone(world, "dlv1", asks("b", mass_kg=3.0))
    await book_alone(world, "dlv2", second)

    await dispatch_fairly(world)

    assert [len(each.shares) for each in await world.planned()] == [0, 0]


@_on_sqlite
async def test_a_host_carries_no_guest_from_another_pickup(world: BusyWorld) -> None:
    """Its drone would have to go there; the search itself proposes no such trip."""
    for number in (1, 2):
        await book_alone(world, f"dlv{number}", asks("b"))
    host, other = await world.planned()
    guest = Guest(share_of(other), other.request, other.mission.packages)
    pickup = guest.request.pickup.model_copy(update={"station_id": "elsewhere"})
    elsewhere = guest.request.model_copy(update={"pickup": pickup})

    assert carrying(host, guest) is not None
    assert carrying(host, replace(guest, request=elsewhere)) is None


@_on_sqlite
async def test_a_shared_trip_waits_for_the_guest_that_is_ready_last(world: BusyWorld) -> None:
    for number in (1, 2, 3):
        await book_alone(world, f"dlv{number}", asks("b"))
    host, *others = await world.planned()
    ready_at = [world.clock.now() + timedelta(minutes=each) for each in (60, 30)]

    trip: MissionRecord | None = host
    for other, at in zip(others, ready_at, strict=True):
        request = other.request.model_copy(update={"earliest_pickup_at": at})
        assert trip is not None
        trip = carrying(trip, Guest(share_of(other), request, other.mission.packages))

    assert trip is not None
    assert trip.request.earliest_pickup_at == ready_at[0]


@_on_sqlite
async def test_no_more_deliveries_share_a_trip_than_at_bookings(world: BusyWorld) -> None:
    for number in range(1, 6):
        await book_alone(world, f"dlv{number}", asks("b"))

    await dispatch_fairly(world)

    shares = [len(each.shares) for each in await world.planned()]
    assert max(shares) == MOST_SHARES
    assert sum(max(1, each) for each in shares) == 5
    await world.end()
    assert sorted(await world.handed_over()) == [(f"dlv{number}", "p1") for number in range(1, 6)]


_WISHES = st.tuples(
    st.lists(st.sampled_from("bc"), min_size=1, max_size=2),
    st.sampled_from([0.0, 900.0, 1_800.0]),
    st.sampled_from([0.4, 4.0]),
    st.sampled_from([1, 1, 2]),
)


@pytest.mark.long
@_on_sqlite
def test_no_customer_loses_when_missions_merge(migrated_url: str) -> None:
    """Each adoption keeps promises and prices, and leaves every calendar whole."""

    async def play(wishes: list[tuple[list[str], float, float, int]], tolerance_s: float) -> None:
        async with BusyWorld(migrated_url) as world:
            for number, (to, wait_s, mass_kg, drone) in enumerate(wishes, 1):
                request = asks(*to, wait_s=wait_s, mass_kg=mass_kg)
                await asked_alone(world, f"dlv{number}", request, drone=drone)
            await dispatch_fairly(world, tolerance_s=tolerance_s)

    @settings(max_examples=5)
    @given(
        wishes=st.lists(_WISHES, min_size=2, max_size=4),
        tolerance_s=st.sampled_from([0.0, 60.0, 1_800.0]),
    )
    def play_all(wishes: list[tuple[list[str], float, float, int]], tolerance_s: float) -> None:
        asyncio.run(play(wishes, tolerance_s))

    play_all()
