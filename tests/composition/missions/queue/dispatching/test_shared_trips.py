"""Deliveries of two customers share a trip, and each customer sees only its own packages."""

import asyncio
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skyway_composition.context import Context
from skyway_composition.live.live_store import missions_with_steps, open_missions
from skyway_composition.live.routes import live_missions
from skyway_composition.missions.booking.book import SharedTrip
from skyway_composition.missions.mission.custody_store import held_packages
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.share_views import mission_of, missions_seen, own_fields
from skyway_composition.missions.queue.dispatching.merger import MOST_SHARES
from skyway_composition.missions.queue.store import refusals_of
from skyway_composition.missions.tracking import track_of
from skyway_composition.retention.forget_store import delete_deliveries, needed_among
from skyway_composition.tables import custody, deliveries, guests, missions, outbox
from skyway_verifier.composition.rules import RULES
from sqlalchemy import delete, select

from skyway.contracts.margins import RiskMargin
from skyway.contracts.mission import Mission
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, StationId
from skyway.runtime.sql.database import Tx
from tests.broken_rules import broken_rules
from tests.composition.busy_world import BusyWorld
from tests.composition.left_packages import left_to_book
from tests.composition.missions.queue.booked_chain import kinds_of, pass_minutes, reports_of
from tests.composition.missions.queue.dispatching.shared_requests import (
    asks,
    finder_of,
    packages_named,
)

_on_sqlite = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def book(world: BusyWorld, delivery_id: str, request: DeliveryRequest) -> None:
    waiting = request.begun_after_wait(world.clock.now())
    ready_at = request.earliest_pickup_at
    booked = await world.book(delivery_id, waiting, loading="AUTOMATIC", ready_at=ready_at)
    assert booked == "BOOKED"
    await world.keep_calendars()


async def shared_mission(world: BusyWorld) -> MissionRecord:
    """The only mission, which flies for both deliveries."""
    (record,) = await world.planned()
    assert [each.delivery_id for each in record.shares] == ["dlv1", "dlv2"]
    return record


async def book_both(world: BusyWorld) -> MissionRecord:
    """Two deliveries that share the trip of the first one."""
    await book(world, "dlv1", asks("b"))
    await book(world, "dlv2", asks("b", "c"))
    await world.check()
    return await shared_mission(world)


async def test_two_deliveries_share_a_trip_and_pay_the_pooled_price(world: BusyWorld) -> None:
    record = await book_both(world)
    host, guest = record.shares
    assert (host.price.amount, host.pooled_price.amount) == (220, 154)
    assert not host.is_pooled

    await world.end()

    for delivery_id, own in (("dlv1", {"p1"}), ("dlv2", {"p1", "p2"})):
        reports = await reports_of(world, delivery_id)
        assert packages_named(reports) == own
        assert "load_before_kg" not in {name for each in reports for name in each.data}
        (loaded,) = [each for each in reports if each.kind == "LOADED"]
        assert loaded.mission is not None
        assert loaded.mission.is_pooled
        assert {*loaded.package_ids} == own
        delivered = [each.package_ids for each in reports if each.kind == "DELIVERED"]
        assert sorted(sum(delivered, ())) == sorted(own)
    assert loaded.mission is not None
    assert loaded.mission.price == guest.pooled_price
    assert sorted(await world.handed_over()) == [("dlv1", "p1"), ("dlv2", "p1"), ("dlv2", "p2")]
    async with world.db.read() as connection:
        held = await held_packages(connection, DeliveryId("dlv2"))
    assert {each.custodian.custodian_id for each in held.values()} == {"b", "c"}


@_on_sqlite
async def test_a_customer_sees_the_drone_and_the_way_with_its_own_packages(
    world: BusyWorld,
) -> None:
    record = await book_both(world)
    while not (await kinds_of(world, "dlv2"))["LOADED"]:
        await pass_minutes(world, 1)

    for share, last in zip(record.shares, ("b", "c"), strict=True):
        (tracked,) = (await track_of(world.db, share.delivery_id)).missions
        assert tracked.mission_id == share.mission_id
        delivered = [each.package_ids for each in tracked.steps if each.kind == "DELIVER"]
        assert {*sum(delivered, ())} == {*share.packages.values()}
        assert (tracked.steps[-1].kind, tracked.steps[-1].station_id) == ("DELIVER", last)
        assert tracked.position is not None
    async with world.db.read() as connection:
        versions = {each.mission_id: each.version for each in await open_missions(connection)}
        found = await missions_with_steps(connection, [record.shares[1].mission_id])
    assert versions.keys() == {each.mission_id for each in record.shares}
    host, guest = (each for one in found for each in live_missions(*one))
    assert (host.flown_as, guest.flown_as) == (None, host.mission_id)
    assert [each.package_id for each in host.packages] == ["p1"]
    assert {each for step in host.steps for each in step.package_ids} == {"p1"}
    assert {each for step in guest.steps for each in step.package_ids} == {"p1", "p2"}
    assert guest.is_carrying


@_on_sqlite
async def test_a_customer_reads_no_reason_that_names_packages_of_others(world: BusyWorld) -> None:
    record = await book_both(world)
    host, guest = record.shares
    own = tuple(guest.packages)
    for kind, code, package_ids, is_shown in (
        ("ACTIVITY", "IMPLAUSIBLE", (), False),
        ("RELEASED", "CANCELLED", own, True),
        ("RELEASED", "CANCELLED", (*host.packages, *own), False),
        ("RETURNING", "PACKAGES_CANCELLED", own, False),
    ):
        why = {"code": code, "detail": "a secret wish", "package_ids": package_ids}
        fields = own_fields(record, guest, kind, why)
        assert fields is not None
        assert ("secret" in fields["detail"]) == is_shown


@_on_sqlite
async def test_a_customer_reads_no_station_of_others_in_the_margin_of_the_trip(
    world: BusyWorld,
) -> None:
    record = await book_both(world)
    risk = RiskMargin(
        reserve_risk=0.001,
        deviations=3.09,
        wind_deviation=0.1,
        use_deviation=0.08,
        model_deviation=0.03,
        flight_margin=0.3,
        from_id=StationId("b"),
        to_id=StationId("c"),
    )
    margins = record.mission.margins.model_copy(update={"risk": risk})
    record = replace(record, mission=record.mission.model_copy(update={"margins": margins}))

    # The host's last package goes to b, the last one of its guest to c.
    shown = [mission_of(record, share).margins.risk for share in record.shares]
    assert [each and (each.from_id, each.to_id) for each in shown] == [(None, None), ("b", "c")]
    assert [each and each.flight_margin for each in shown] == [0.3, 0.3]


@_on_sqlite
@pytest.mark.parametrize(("later_s", "joins"), [(20, True), (3600, False)])
async def test_a_guest_is_never_picked_up_before_its_packages_are_there(
    world: BusyWorld, later_s: int, joins: bool
) -> None:
    await book(world, "dlv1", asks("b"))
    (alone,) = await world.planned()
    ready_at = alone.mission.start_at + timedelta(seconds=later_s)
    await book(world, "dlv2", asks("b", wait_s=0.0, earliest_pickup_at=ready_at))

    seen = [one for record in await world.planned() for one in missions_seen(record)]
    starts = {str(each.delivery_id): each.start_at for each in seen}
    assert starts["dlv2"] >= ready_at
    assert (starts["dlv1"] == starts["dlv2"]) == joins


@_on_sqlite
async def test_a_delivery_that_is_left_alone_pays_its_full_price(world: BusyWorld) -> None:
    await book_both(world)

    answer = await world.cancel("dlv1", None)
    assert answer.released == ("p1",)
    await world.check()
    await world.keep_calendars()
    await world.check()
    await world.end()

    assert sorted(await world.handed_over()) == [("dlv2", "p1"), ("dlv2", "p2")]
    (loaded,) = [each for each in await reports_of(world, "dlv2") if each.kind == "LOADED"]
    assert loaded.mission is None
    kinds = await kinds_of(world, "dlv1")
    assert kinds["RELEASED"] == 1
    assert kinds["LOADED"] == 0


@_on_sqlite
async def test_a_guest_that_cancels_leaves_the_promise_of_its_host(world: BusyWorld) -> None:
    await book(world, "dlv1", asks("b"))
    (alone,) = await world.planned()
    await book(world, "dlv2", asks("b", "c"))
    await world.cancel("dlv2", ("p2",))
    await world.cancel("dlv2", None)
    await world.keep_calendars()

    (record,) = await world.planned()
    assert [each.package_id for each in record.request.packages] == ["p1"]
    assert record.mission.packages[0].eta_at <= alone.mission.packages[0].eta_at
    await world.end()
    assert await world.handed_over() == [("dlv1", "p1")]


@pytest.mark.long
@_on_sqlite
async def test_a_package_that_is_cancelled_in_flight_comes_back_alone(world: BusyWorld) -> None:
    await book_both(world)
    while not (await kinds_of(world, "dlv2"))["LOADED"]:
        await pass_minutes(world, 1)

    answer = await world.cancel("dlv2", ("p2",))
    assert answer.returning == ("p2",)
    await world.end()

    assert sorted(await world.handed_over()) == [("dlv1", "p1"), ("dlv2", "p1")]
    assert (await kinds_of(world, "dlv2"))["RETURNED"] == 1
    assert (await kinds_of(world, "dlv1"))["RETURNING"] == 0


@pytest.mark.long
@_on_sqlite
async def test_both_deliveries_are_booked_again_when_the_drone_refuses(world: BusyWorld) -> None:
    record = await book_both(world)
    drone = next(each for each in world.drones if each.drone_id == record.drone_id)
    drone.refuses_next = True
    while not (await kinds_of(world, "dlv2"))["REFUSED"]:
        await pass_minutes(world, 1)

    both = {DeliveryId("dlv1"), DeliveryId("dlv2")}
    async with world.db.read() as connection:
        # The dispatcher gives neither to this drone again.
        assert await refusals_of(connection, both) == {(each, drone.drone_id) for each in both}
    for delivery_id in ("dlv1", "dlv2"):
        assert (await kinds_of(world, delivery_id))["REFUSED"] == 1
        left = await left_to_book(world, delivery_id)
        assert left is not None
        assert await world.book(delivery_id, left, loading="AUTOMATIC") == "BOOKED"
    await world.end()
    assert sorted(await world.handed_over()) == [("dlv1", "p1"), ("dlv2", "p1"), ("dlv2", "p2")]


@_on_sqlite
@pytest.mark.parametrize(
    "second",
    [
        asks("b", qos={"objective": "CHEAPEST"}),
        asks("b", mass_kg=3.0),
        asks("b", latest_pickup_at="2026-03-02T12:00:00Z"),
        asks("b", qos={"objective": "FASTEST", "pooling": True}),
    ],
    ids=["no pooling", "too heavy together", "a window", "sooner alone"],
)
async def test_a_request_that_cannot_share_or_gains_nothing_flies_alone(
    world: BusyWorld, second: DeliveryRequest
) -> None:
    await book(world, "dlv1", asks("b", mass_kg=3.0))
    (before,) = await world.planned()

    await book(world, "dlv2", second)

    assert all(each.shares == () for each in await world.planned())
    assert before in await world.planned()


@_on_sqlite
@pytest.mark.parametrize(("objective", "joins"), [("CHEAPEST", False), ("GREENEST", True)])
async def test_a_guest_that_may_be_left_alone_pays_no_more_than_its_best_offer(
    world: BusyWorld, objective: str, joins: bool
) -> None:
    await book(world, "dlv1", asks("b"))
    found = finder_of(world)
    joints: list[SharedTrip | None] = []

    class WithACheaperOffer:
        """Finds shared trips for requests with a slightly cheaper offer of another provider."""

        async def find(self, of: Any, requested: Any, offers: Any) -> None:
            (part,) = offers.ranked[0].parts
            price = part.price.model_copy(update={"amount": part.price.amount - 1})
            candidate = part.candidate.model_copy(update={"provider_id": "prv_other"})
            parts = (replace(part, price=price, candidate=candidate),)
            ranked = (replace(offers.ranked[0], parts=parts), *offers.ranked)
            joints.append(await found.find(of, requested, replace(offers, ranked=ranked)))

    world.bookings = replace(world.bookings, shared=WithACheaperOffer())
    qos = {"objective": objective, "pooling": True, "pooling_wait_s": 1200.0}
    await book(world, "dlv2", asks("b", qos=qos))

    assert [each is not None for each in joints] == [joins]


@_on_sqlite
async def test_a_repeated_booking_of_a_guest_gets_the_same_mission(world: BusyWorld) -> None:
    record = await book_both(world)
    world.attempts["dlv2"] = 0
    await book(world, "dlv2", asks("b", "c"))
    assert await shared_mission(world) == record


@_on_sqlite
async def test_a_cancellation_between_planning_and_joining_has_the_request_fly_alone(
    world: BusyWorld,
) -> None:
    await book(world, "dlv1", asks("b"))
    found = finder_of(world)

    class Interrupted:
        """Finds a shared trip, and has the host cancelled before the request can join it."""

        async def find(self, *asked: Any) -> SharedTrip | None:
            joint = await found.find(*asked)
            assert joint is not None
            await world.cancel("dlv1", None)
            return joint

    world.bookings = replace(world.bookings, shared=Interrupted())
    await book(world, "dlv2", asks("b", "c"))

    (record,) = await world.planned()
    assert (record.mission.delivery_id, record.shares) == ("dlv2", ())
    await world.check()


@_on_sqlite
async def test_requests_that_join_in_parallel_all_fly(world: BusyWorld) -> None:
    await book(world, "dlv1", asks("b"))

    async with asyncio.TaskGroup() as customers:
        for delivery_id in ("dlv2", "dlv3", "dlv4"):
            request = asks("b").begun_after_wait(world.clock.now())
            customers.create_task(world.book(delivery_id, request, loading="AUTOMATIC"))

    await world.check()
    shares = [each.delivery_id for one in await world.planned() for each in one.shares]
    assert len(shares) == len(set(shares)) == MOST_SHARES
    await world.end()
    assert sorted(await world.handed_over()) == [(f"dlv{n}", "p1") for n in range(1, 5)]


class _KilledError(Exception):
    """The process ends here, as after kill -9."""


@_on_sqlite
async def test_a_kill_before_the_end_of_the_transaction_leaves_the_calendar_whole(
    world: BusyWorld,
) -> None:
    await book(world, "dlv1", asks("b"))
    before = await world.planned()
    found = finder_of(world)

    class Killed:
        """Finds shared trips, and is killed after all writes of a join."""

        joint: SharedTrip | None = None
        first_start_ms = 2**62

        async def find(self, *asked: Any) -> SharedTrip | None:
            self.joint = await found.find(*asked)
            return self

        async def join(self, context: Context, tx: Tx) -> Mission:
            assert self.joint is not None
            await self.joint.join(context, tx)
            raise _KilledError

    world.bookings = replace(world.bookings, shared=Killed())
    with pytest.raises(_KilledError):
        await book(world, "dlv2", asks("b", "c"))
    assert await world.planned() == before
    await world.check()

    world.restart()
    world.attempts["dlv2"] = 0
    await book(world, "dlv2", asks("b", "c"))
    await shared_mission(world)
    await world.end()


async def test_a_shared_mission_is_deleted_with_its_last_delivery(world: BusyWorld) -> None:
    record = await book_both(world)
    await world.end()
    host, guest = (each.delivery_id for each in record.shares)

    async def forget(asked: DeliveryId) -> set[DeliveryId]:
        async with world.db.write() as tx:
            await tx.execute(delete(outbox))
            kept = await needed_among(tx, [asked], blamed_ms=world.now_ms)
            await delete_deliveries(tx, {asked} - kept)
            return kept

    assert await forget(host) == {host}
    assert await forget(guest) == set()
    assert await broken_rules(world.db, RULES, wall_at=world.clock.wall_now()) == []
    assert await forget(host) == set()
    async with world.db.read() as connection:
        for table in (missions, guests, custody, deliveries):
            assert (await connection.execute(select(table))).all() == []


async def arrivals(world: BusyWorld) -> dict[tuple[str, str], datetime]:
    """When each package arrives, by its delivery and the id of its customer."""
    return {
        (str(mission.delivery_id), str(each.package_id)): each.eta_at
        for record in await world.planned()
        for mission in missions_seen(record)
        for each in mission.packages
    }


_WISHES = st.tuples(
    st.lists(st.sampled_from("bc"), min_size=1, max_size=2),
    st.sampled_from([0.0, 600.0, 1_800.0]),
    st.sampled_from(["CHEAPEST", "GREENEST", "FASTEST"]),
    st.sampled_from([0.4, 4.0]),
)


@pytest.mark.long
@_on_sqlite
def test_no_promise_gets_worse_when_others_join(migrated_url: str) -> None:
    """Each booking leaves every promise that was given before within the tolerance."""

    async def play(wishes: list[tuple[list[str], float, str, float]]) -> None:
        async with BusyWorld(migrated_url) as world:
            promised: dict[tuple[str, str], datetime] = {}
            for number, (to, wait_s, objective, mass_kg) in enumerate(wishes, 1):
                qos = {"objective": objective, "pooling": True, "pooling_wait_s": wait_s}
                request = asks(*to, mass_kg=mass_kg, qos=qos).begun_after_wait(world.clock.now())
                await world.book(f"dlv{number}", request, loading="AUTOMATIC")
                await world.check()
                now = await arrivals(world)
                latest = {each: at + timedelta(seconds=60) for each, at in promised.items()}
                assert all(now[each] <= at for each, at in latest.items())
                promised = now | promised

    @settings(max_examples=8)
    @given(wishes=st.lists(_WISHES, min_size=2, max_size=5))
    def play_all(wishes: list[tuple[list[str], float, str, float]]) -> None:
        asyncio.run(play(wishes))

    play_all()
