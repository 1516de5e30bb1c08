"""Booking on both databases: a delivery is booked whole or not at all, and only once."""

import asyncio
import itertools
import logging
from collections.abc import Awaitable, Callable
from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.missions.booking.book import Bookings
from skyway_composition.planning.solver_pool import SolverPool
from sqlalchemy import text

from skyway.contracts.flight_step import FlyStep, RechargeStep
from skyway.contracts.mission import Booking, BookMissions
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.plan import Plan
from skyway.ids import DeliveryId
from skyway.planner.problem import Problem
from skyway.runtime.errors import RowRefused
from skyway.units import moment_to_ms
from tests.counting_mint import CountingMint

#: What a booking writes; an attempt that fails may leave none of it.
WRITTEN = ("missions", "mission_steps", "pad_reservations", "instructions", "custody", "outbox")


async def count(composition: Any, table: str) -> int:
    (row,) = await composition.rows(f"SELECT count(*) AS n FROM {table}")
    return int(row.n)


@pytest.fixture
def refusals(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    """Returns the names of the database rules that refused bookings."""
    caplog.set_level(logging.INFO, "skyway_composition.missions.booking.rounds")
    return lambda: [record.__dict__["by"] for record in caplog.records if "by" in record.__dict__]


async def test_a_booking_reserves_drone_and_pads_and_sends_the_mission(
    composition: Any,
) -> None:
    booking = await composition.book()

    (mission,) = booking.missions
    (instruction,) = await composition.sent()
    assert booking.outcome == "BOOKED"
    assert instruction.mission_id == mission.mission_id
    assert (instruction.stream, instruction.seq, instruction.first_step) == (1, 1, 1)
    assert {row.mission_id for row in await composition.reservations()} == {mission.mission_id}
    assert await composition.broken() == []


async def test_only_a_drone_that_fits_the_pads_on_its_way_is_booked(
    composition: Any, make: Any
) -> None:
    network = make.network()
    for feature in network["features"]:
        if feature["properties"].get("station_id") == "b":
            feature["properties"]["pad_connectors"] = ["blade"]
    await composition.publish(network)
    model = make.candidate().model
    pin, blade = (
        make.candidate(number, model=model.model_copy(update={"model_id": each, "connector": each}))
        for number, each in enumerate(("pin", "blade"), 1)
    )

    unfit = await composition.book(pin, delivery_id="dlv_1")
    booked = await composition.book(pin, blade, delivery_id="dlv_2")

    assert [each.code for each in unfit.reasons] == ["OUT_OF_RANGE"]
    (mission,) = booked.missions
    assert mission.drone_id == blade.drone_id
    assert "b" in {row.station_id for row in await composition.reservations()}
    assert await composition.broken() == []


async def test_pads_are_reserved_for_the_recharge_and_the_gap(composition: Any, make: Any) -> None:
    await composition.publish(make.network(pad_gap_s=90))

    await composition.book()

    (instruction,) = await composition.sent()
    windows = {
        (
            step.station_id,
            step.pad,
            moment_to_ms(step.not_before_at),
            moment_to_ms(step.not_after_at) + 90_000,
        )
        for step in instruction.steps
        if isinstance(step, RechargeStep)
    }
    booked = {tuple(row)[:4] for row in await composition.reservations()}
    assert windows == booked


async def test_the_drone_flies_home_and_recharges_there(composition: Any) -> None:
    booking = await composition.book()

    (instruction,) = await composition.sent()
    *_, last_flight, recharge = instruction.steps
    assert isinstance(last_flight, FlyStep)
    assert last_flight.lands
    assert isinstance(recharge, RechargeStep)
    assert (recharge.station_id, recharge.until_soc) == ("a", 1.0)
    assert moment_to_ms(booking.missions[0].released_at) == moment_to_ms(recharge.not_after_at)


async def test_a_repeated_attempt_returns_the_same_mission(composition: Any) -> None:
    first = await composition.book()

    again = await composition.book()

    assert again == first
    assert len(await composition.sent()) == 1


async def test_concurrent_puts_of_one_attempt_book_once(composition: Any, make: Any) -> None:
    drones = [make.candidate(number) for number in range(4)]

    bookings = await asyncio.gather(*(composition.book(*drones) for _ in range(6)))

    assert {booking.missions[0].mission_id for booking in bookings} == {
        bookings[0].missions[0].mission_id
    }
    assert await count(composition, "missions") == 1


async def test_a_call_that_comes_while_the_same_one_is_planned_plans_nothing(
    composition: Any, make: Any
) -> None:
    """The gateway has given up the first call, and asks again without candidates."""
    begun, goes_on = asyncio.Event(), asyncio.Event()
    rounds = list[str]()

    class SlowTrips:
        async def find(self, delivery_id: str, *_: object) -> None:
            rounds.append(delivery_id)
            begun.set()
            await goes_on.wait()

    trips: Any = SlowTrips()
    bookings = replace(composition.parts.bookings, shared=trips)
    asked = BookMissions(
        attempt=1, request=make.request("c"), shortlist=Shortlist.of([make.candidate()])
    )
    first = asyncio.create_task(bookings.book("dlv_1", asked))
    await begun.wait()
    first.cancel()
    await asyncio.wait({first})
    again = asked.model_copy(update={"shortlist": Shortlist()})
    second = asyncio.create_task(bookings.book("dlv_1", again))
    await asyncio.sleep(0)
    goes_on.set()

    assert (await second).outcome == "BOOKED"
    assert rounds == ["dlv_1"]
    assert bookings.under_way == {}


async def test_twelve_bookings_of_one_drone_send_one_mission(composition: Any) -> None:
    bookings = await asyncio.gather(
        *(composition.book(delivery_id=f"dlv_{number}") for number in range(12))
    )

    outcomes = [booking.outcome for booking in bookings]
    states = [mission.state for booking in bookings for mission in booking.missions]
    # A booking may lose too many rounds against the others; the gateway asks again then.
    assert set(outcomes) <= {"BOOKED", "BUSY"}
    assert states.count("BOOKED") == 1
    assert states.count("QUEUED") == outcomes.count("BOOKED") - 1 > 0
    assert await count(composition, "missions") == outcomes.count("BOOKED")
    assert await composition.broken() == []


async def test_twelve_bookings_never_reserve_one_pad_twice(composition: Any, make: Any) -> None:
    await composition.publish(make.network(pads=dict.fromkeys("abcde", 1)))

    bookings = await asyncio.gather(
        *(
            composition.book(make.candidate(number), delivery_id=f"dlv_{number}")
            for number in range(12)
        )
    )

    rows = await composition.reservations()
    by_pad: dict[tuple[str, int], list[Any]] = {}
    for row in rows:
        by_pad.setdefault((row.station_id, row.pad), []).append(row)
    assert "BOOKED" in {booking.outcome for booking in bookings}
    for held in by_pad.values():
        assert all(before.end_ms <= after.start_ms for before, after in itertools.pairwise(held))
    assert await composition.broken() == []


@pytest.mark.parametrize(
    "overlap",
    ["start_ms + 1, end_ms + 1", "start_ms - 1, start_ms + 1", "end_ms - 1, end_ms + 5"],
)
async def test_the_database_refuses_a_reserved_pad(composition: Any, overlap: str) -> None:
    await composition.book()

    with pytest.raises(RowRefused) as refused:
        await write(
            composition,
            f"INSERT INTO pad_reservations (station_id, pad, start_ms, end_ms, mission_id) "
            f"SELECT station_id, pad, {overlap}, mission_id "
            "FROM pad_reservations WHERE station_id = 'b' AND pad = 0",
        )

    assert refused.value.constraint == "pad_taken"


async def test_the_database_refuses_to_move_a_reservation_onto_another(
    composition: Any,
) -> None:
    await composition.book()
    await write(
        composition,
        "INSERT INTO pad_reservations (station_id, pad, start_ms, end_ms, mission_id) "
        "SELECT 'e', 0, n, n + 10, mission_id FROM missions, "
        "(SELECT 100 AS n UNION SELECT 200) AS starts",
    )

    with pytest.raises(RowRefused) as refused:
        await write(composition, "UPDATE pad_reservations SET end_ms = 201 WHERE start_ms = 100")

    assert refused.value.constraint == "pad_taken"


async def test_reservations_that_touch_do_not_overlap(composition: Any) -> None:
    await composition.book()

    await write(
        composition,
        "INSERT INTO pad_reservations (station_id, pad, start_ms, end_ms, mission_id) "
        "SELECT station_id, pad, end_ms, end_ms + 1, mission_id "
        "FROM pad_reservations WHERE station_id = 'c'",
    )

    assert not [each for each in await composition.broken() if each[0].startswith("I1")]


async def test_the_database_refuses_a_drone_on_two_missions(composition: Any) -> None:
    await composition.book()

    with pytest.raises(RowRefused) as refused:
        await write(
            composition,
            "INSERT INTO missions (mission_id, delivery_id, attempt, trip, provider_id, drone_id, "
            "state, network_id, start_ms, served_ms, released_ms, expires_ms, body, request, "
            "candidate, "
            "report_seq) SELECT 'other', delivery_id, 2, trip, provider_id, drone_id, 'ACTIVE', "
            "network_id, start_ms, served_ms, released_ms, expires_ms, body, request, candidate, 0 "
            "FROM missions",
        )

    assert refused.value.constraint == "mission_drone"


async def test_a_booking_that_fails_at_its_last_row_leaves_nothing(
    composition: Any,
    make: Any,
) -> None:
    parts = composition.parts
    failing = Bookings(replace(parts, mint=NoInstruction()))

    with pytest.raises(RuntimeError):
        await failing.book(DeliveryId("dlv_1"), booking_request(make))

    assert {table: await count(composition, table) for table in WRITTEN} == dict.fromkeys(
        WRITTEN, 0
    )


async def test_a_closed_delivery_is_not_booked(composition: Any) -> None:
    closed = await composition("service:gateway", "PUT", "/internal/deliveries/dlv_1/closed")

    booking = await composition.book()

    assert closed.json() == {"is_closed": True, "missions": []}
    assert booking.outcome == "CLOSED"
    assert await composition.sent() == []


async def test_a_booked_delivery_is_not_closed(composition: Any) -> None:
    booking = await composition.book()

    closed = await composition("service:gateway", "PUT", "/internal/deliveries/dlv_1/closed")

    assert closed.json()["is_closed"] is False
    assert closed.json()["missions"][0]["mission_id"] == booking.missions[0].mission_id


async def test_concurrent_closing_and_booking_never_both_succeed(
    composition: Any, make: Any
) -> None:
    async def race(number: int) -> tuple[str, bool]:
        booking, closed = await asyncio.gather(
            composition.book(make.candidate(number), delivery_id=f"dlv_{number}"),
            composition("service:gateway", "PUT", f"/internal/deliveries/dlv_{number}/closed"),
        )
        return booking.outcome, closed.json()["is_closed"]

    results = await asyncio.gather(*(race(number) for number in range(8)))

    assert set(results) <= {("BOOKED", False), ("CLOSED", True), ("BUSY", True)}
    assert await composition.broken() == []


async def test_a_plan_made_on_an_older_network_is_not_booked(composition: Any, make: Any) -> None:
    cut_off = make.network()
    cut_off["features"] = [
        feature for feature in cut_off["features"] if feature["properties"].get("from") != "b"
    ]

    booking = await book_while(
        composition, booking_request(make), lambda: composition.publish(cut_off)
    )

    assert booking.outcome == "INFEASIBLE"
    assert await composition.reservations() == []


async def test_a_plan_whose_start_has_passed_is_not_booked(composition: Any, make: Any) -> None:
    async def plan_for_an_hour() -> None:
        composition.clock.advance(timedelta(hours=1))

    booking = await book_while(composition, booking_request(make), plan_for_an_hour)

    assert booking.outcome == "BOOKED"
    (instruction,) = await composition.sent()
    assert instruction.steps[0].planned_start_at >= composition.clock.now()


@pytest.mark.parametrize("faster_drone", [1, 2])
async def test_a_booking_that_loses_a_race_returns_the_winning_booking(
    composition: Any, make: Any, refusals: Callable[[], list[str]], faster_drone: int
) -> None:
    faster: list[Booking] = []

    async def book_faster() -> None:
        faster.append(await composition.book(make.candidate(faster_drone)))

    booking = await book_while(composition, booking_request(make), book_faster)

    # The database decides which of the two rows it refuses first.
    assert len(refusals()) == 1
    assert booking == faster[0]
    assert booking.missions[0].drone_id == f"drn_{faster_drone}"
    assert await count(composition, "missions") == 1
    assert await composition.broken() == []


async def test_a_booking_that_loses_a_race_with_closing_books_nothing(
    composition: Any, make: Any, refusals: Callable[[], list[str]]
) -> None:
    async def close() -> None:
        path = "/internal/deliveries/dlv_1/closed"
        closed = await composition("service:gateway", "PUT", path)
        assert closed.json()["is_closed"] is True

    booking = await book_while(composition, booking_request(make), close)

    assert refusals() == ["deliveries_pkey"]
    assert booking.outcome == "CLOSED"
    assert await count(composition, "missions") == 0
    assert await composition.reservations() == []


async def test_a_free_drone_is_booked_instead_of_a_busy_one(composition: Any, make: Any) -> None:
    await composition.book(make.candidate(1))

    booking = await composition.book(make.candidate(1), make.candidate(2), delivery_id="dlv_2")

    assert booking.missions[0].drone_id == "drn_2"


async def test_a_drone_waits_for_a_reserved_pad(composition: Any, make: Any) -> None:
    await composition.publish(make.network(pads={"b": 1}))
    first = await composition.book(make.candidate(1))

    second = await composition.book(make.candidate(2), delivery_id="dlv_2")

    assert (second.missions[0].plan.waiting_s or 0) > 0
    assert second.missions[0].packages[0].eta_at > first.missions[0].packages[0].eta_at


def booking_request(make: Any) -> BookMissions:
    return BookMissions(
        attempt=1, request=make.request("c"), shortlist=Shortlist.of([make.candidate()])
    )


async def write(composition: Any, statement: str) -> None:
    async with composition.db.write() as tx:
        await tx.execute(text(statement))


class NoInstruction(CountingMint):
    """Mints all ids except those of instructions, the last rows of a booking."""

    def __call__(self, prefix: str) -> str:
        if prefix == "ins":
            raise RuntimeError("the process dies here")
        return super().__call__(prefix)


async def book_while(
    composition: Any, requested: BookMissions, meanwhile: Callable[[], Awaitable[None]]
) -> Booking:
    """Book the new delivery dlv_1; `meanwhile` runs as soon as the first plan is made."""
    parts = composition.parts
    async with InterruptedSolver(meanwhile) as solver:
        bookings = Bookings(parts.planning_with(solver))
        return await bookings.book(DeliveryId("dlv_1"), requested)


class InterruptedSolver(SolverPool):
    """A solver that runs `meanwhile` after its first plan, before it returns that plan."""

    def __init__(self, meanwhile: Callable[[], Awaitable[None]]) -> None:
        super().__init__(threads=1, time_limit_s=5.0)
        self._meanwhile: Callable[[], Awaitable[None]] | None = meanwhile

    async def compose(self, problem: Problem, **options: Any) -> Plan:
        plan = await super().compose(problem, **options)
        if self._meanwhile is not None:
            meanwhile, self._meanwhile = self._meanwhile, None
            await meanwhile()
        return plan
