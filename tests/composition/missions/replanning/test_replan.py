"""Replanning: a drone that stands and waits gets another plan."""

from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.missions.replanning.store import claim_stuck, plan_now, put_off
from sqlalchemy import text

from skyway.contracts.flight_step import DeliverStep, PickUpStep
from skyway.drone.models import DRONE_MODELS
from skyway.ids import DroneModelId
from skyway.runtime.errors import ServiceUnavailable
from skyway.units import moment_to_ms

KEEPS_A_TENTH = DRONE_MODELS[DroneModelId("paper-scenario")].model_copy(update={"reserve_soc": 0.1})

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def flown_until(
    composition: Any,
    drone: Any,
    *candidates: Any,
    failing: int,
    station_id: str,
    soc: float = 0.9,
    code: str = "PAD_LOST",
) -> Any:
    """The mission's instruction, after all steps before `failing` ended and `failing` failed."""
    await composition.book(*candidates, delivery_id=f"dlv_of_{drone.drone_id}")
    (instruction,) = await composition.sent(drone.drone_id)
    events = drone.flown(instruction)[: failing - 1]
    drone.event_seq = failing - 1
    failure = drone.event(
        "STEP_FAILED",
        mission_id=instruction.mission_id,
        mission_revision=1,
        step_id=failing,
        station_id=station_id,
        soc=soc,
        code=code,
        detail="came too late for the pad",
    )
    await composition.receive(drone.ack(instruction), *events, failure)
    return instruction


async def test_a_failed_step_leads_to_a_revision_from_where_the_drone_stands(
    composition: Any, drone: Any
) -> None:
    first = await flown_until(composition, drone, failing=3, station_id="b")

    await composition.replanner.step()

    (revision,) = await composition.sent()
    assert (revision.mission_id, revision.mission_revision) == (first.mission_id, 2)
    assert revision.first_step == revision.steps[0].step_id == 4
    assert not any(isinstance(step, PickUpStep) for step in revision.steps)
    delivered = [step for step in revision.steps if isinstance(step, DeliverStep)]
    assert [(step.station_id, step.package_ids) for step in delivered] == [("c", ("p1",))]
    assert await composition.broken() == []


async def test_a_new_plan_is_reported_to_the_customer(composition: Any, drone: Any) -> None:
    await flown_until(composition, drone, failing=3, station_id="b")

    await composition.replanner.step()

    report = (await composition.reports())[-1]
    assert (report.kind, report.code) == ("REPLANNED", "PAD_LOST")
    assert report.mission.revision == 2
    assert report.etas == report.mission.packages


async def test_a_revision_is_flown_to_the_end(composition: Any, drone: Any) -> None:
    first = await flown_until(composition, drone, failing=3, station_id="b")
    composition.clock.advance(first.steps[1].planned_end_at - composition.clock.now())
    await composition.replanner.step()
    (revision,) = await composition.sent()

    await composition.receive(drone.ack(revision), *drone.flown(revision))

    reports = await composition.reports()
    assert [report.kind for report in reports][-3:] == ["REPLANNED", "DELIVERED", "ENDED"]
    assert await composition.state_of(revision.mission_id) == "COMPLETED"
    assert await composition.broken() == []


async def test_after_a_failure_before_the_pickup_the_packages_are_still_fetched(
    composition: Any, drone: Any, make: Any
) -> None:
    await composition.book(make.candidate(station_id="b"))
    (instruction,) = await composition.sent()
    failure = drone.event(
        "STEP_FAILED", mission_id=instruction.mission_id, step_id=1, station_id="b", soc=0.95
    )

    await composition.receive(drone.ack(instruction), failure)
    await composition.replanner.step()

    (revision,) = await composition.sent()
    assert any(isinstance(step, PickUpStep) for step in revision.steps)


async def test_after_a_failure_on_the_way_home_only_the_way_home_is_planned(
    composition: Any, drone: Any
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    delivered = next(step for step in instruction.steps if isinstance(step, DeliverStep))
    events = drone.flown(instruction)[: delivered.step_id]
    drone.event_seq = delivered.step_id
    failure = drone.event(
        "STEP_FAILED",
        mission_id=instruction.mission_id,
        step_id=delivered.step_id + 1,
        station_id="c",
        soc=0.1,
    )

    await composition.receive(drone.ack(instruction), *events, failure)
    await composition.replanner.step()

    (revision,) = await composition.sent()
    assert not any(isinstance(step, DeliverStep | PickUpStep) for step in revision.steps)
    assert revision.steps[-1].station_id == "a"


async def test_after_a_refused_revision_the_next_plan_follows_the_released_steps(
    composition: Any, drone: Any
) -> None:
    first = await flown_until(composition, drone, failing=3, station_id="b")
    await composition.replanner.step()
    (revision,) = await composition.sent()
    state = drone.state(
        mission_id=first.mission_id, station_id="b", soc=0.9, step_id=5, released_through=6
    )

    await composition.receive(state, drone.ack(revision, "REJECTED", code="STEP_RELEASED"))
    await composition.replanner.step()

    (another,) = await composition.sent()
    assert (another.mission_revision, another.first_step) == (3, 7)


async def test_without_a_route_to_the_recipient_the_packages_go_back(
    composition: Any, drone: Any, make: Any
) -> None:
    await flown_until(composition, drone, failing=3, station_id="b")
    one_way = make.network()
    one_way["features"] = [
        each for each in one_way["features"] if each["properties"].get("from") != "b"
    ]
    await composition.publish(one_way)

    await composition.replanner.step()
    (revision,) = await composition.sent()
    await composition.receive(drone.ack(revision), *drone.flown(revision))

    assert [step.kind for step in revision.steps][-2:] == ["RETURN", "RECHARGE"]
    reports = await composition.reports()
    assert [(each.kind, each.package_ids) for each in reports][-4:] == [
        ("RETURNING", ("p1",)),
        ("REPLANNED", ()),
        ("RETURNED", ("p1",)),
        ("ENDED", ()),
    ]
    assert reports[-1].mission_state == "COMPLETED"
    assert await composition.broken() == []


async def test_without_any_route_the_packages_are_stranded_where_the_drone_stands(
    composition: Any, drone: Any, make: Any
) -> None:
    first = await flown_until(composition, drone, failing=3, station_id="b")
    cut_off = make.network()
    cut_off["features"] = [
        each
        for each in cut_off["features"]
        if "b" not in (each["properties"].get("from"), each["properties"].get("to"))
    ]
    await composition.publish(cut_off)

    await composition.replanner.step()

    report = (await composition.reports())[-1]
    assert (report.kind, report.mission_state) == ("ENDED", "ABORTED")
    assert (report.stranded_package_ids, report.station_id) == (("p1",), "b")
    assert await composition.reservations() == []
    chain = await composition.rows("SELECT custodian_kind, custodian_id FROM custody")
    assert tuple(chain[-1]) == ("STATION", "b")
    assert await composition.state_of(first.mission_id) == "ABORTED"
    assert await composition.broken() == []
    (call_off,) = await composition.sent()
    assert (call_off.kind, call_off.mission_id) == ("CANCEL", first.mission_id)


async def test_a_lost_journal_in_flight_leads_to_a_revision_in_a_new_stream(
    composition: Any, drone: Any
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    pick_up, *_ = drone.flown(instruction)
    await composition.receive(drone.ack(instruction), pick_up)
    drone.session, drone.stream, drone.event_seq = 2, 0, 0

    await composition.receive(drone.state(station_id="a", soc=1.0))
    await composition.replanner.step()

    (revision,) = await composition.sent()
    assert (revision.stream, revision.seq, revision.mission_revision) == (2, 1, 2)


async def test_a_drone_that_lost_its_journal_is_sent_its_load(composition: Any, drone: Any) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    pick_up, *_ = drone.flown(instruction)
    await composition.receive(drone.ack(instruction), pick_up)
    drone.session, drone.stream, drone.event_seq = 2, 0, 0
    await composition.receive(drone.state(station_id="a", soc=1.0))
    await composition.replanner.step()
    (revision,) = await composition.sent()
    drone.stream = 2

    await composition.receive(drone.ack(revision), *drone.flown(revision))

    assert [step.kind for step in revision.steps[:2]] == ["PICK_UP", "FLY"]
    kinds = [report.kind for report in await composition.reports()]
    assert kinds[3:] == ["REPLANNING", "REPLANNED", "DELIVERED", "ENDED"]
    assert await composition.broken() == []


async def test_a_drone_below_its_reserve_charges_where_it_stands_first(
    composition: Any, drone: Any, make: Any
) -> None:
    keeps_some = make.candidate(model=KEEPS_A_TENTH)
    await flown_until(composition, drone, keeps_some, failing=3, station_id="b", soc=0.05)

    await composition.replanner.step()

    (revision,) = await composition.sent()
    charge, *onward = revision.steps
    assert (charge.kind, charge.station_id) == ("RECHARGE", "b")
    assert [step.package_ids for step in onward if isinstance(step, DeliverStep)] == [("p1",)]
    assert await composition.broken() == []


class ClosingsAway:
    """`Closings` that fail like a database that is away for a moment."""

    def __init__(self, now_ms: int) -> None:
        self.now_ms = now_ms

    @property
    def db(self) -> Any:
        raise ServiceUnavailable("the database", "it is away")


async def test_an_error_for_one_mission_does_not_stop_planning_for_others(
    composition: Any, drone: Any, make: Any
) -> None:
    other = type(drone)(composition, drone_id="drn_2")
    await flown_until(composition, drone, failing=3, station_id="b", code="PAD_OCCUPIED")
    await flown_until(composition, other, make.candidate(2), failing=3, station_id="b")
    failing = replace(composition.replanner, closings=ClosingsAway(composition.parts.now_ms))

    with pytest.raises(ExceptionGroup, match="missions not replanned"):
        await failing.step()

    assert [each.mission_revision for each in await composition.sent("drn_2")] == [2]
    # The claim of the failed mission is over soon.
    composition.clock.advance(timedelta(seconds=6))
    await composition.replanner.step()
    assert [each.mission_revision for each in await composition.sent("drn_1")] == [2]


async def test_a_plan_that_is_outdated_is_made_again_immediately(
    composition: Any, drone: Any
) -> None:
    await flown_until(composition, drone, failing=3, station_id="b")
    clock, solver = composition.clock, composition.parts.solver

    class SlowSolver:
        def __getattr__(self, name: str) -> Any:
            clock.advance(timedelta(hours=1))
            return getattr(solver, name)

    slow: Any = SlowSolver()
    context = composition.parts.planning_with(slow)
    await replace(composition.replanner, context=context).step()

    [row] = await composition.rows("SELECT retry_wall_ms FROM missions")
    assert await composition.sent() == []
    assert row.retry_wall_ms == 0


async def test_a_plan_requested_during_planning_is_not_put_off(
    composition: Any, drone: Any
) -> None:
    first = await flown_until(composition, drone, failing=3, station_id="b")
    db, clock = composition.db, composition.clock
    found = []
    for is_requested in (False, True):
        await claim_stuck(db, clock, "test")
        later_ms = moment_to_ms(clock.wall_now()) + 2_000
        async with db.write() as tx:
            if is_requested:
                await plan_now(tx, first.mission_id)
            await put_off(tx, first.mission_id, until_wall_ms=later_ms)
        found.append(await claim_stuck(db, clock, "test"))
        clock.advance(timedelta(seconds=10))

    assert found == [[], ["drn_1"]]


async def test_a_drone_that_refuses_all_revisions_raises_one_alarm(
    composition: Any, drone: Any
) -> None:
    await composition.book()
    (first,) = await composition.sent()
    pick_up, flight = first.steps[:2]
    composition.clock.advance(pick_up.planned_end_at - composition.clock.now())
    wish = drone.event("ALARM", mission_id=first.mission_id, code="PLAN_WANTED")
    await composition.receive(drone.ack(first), *drone.ended(first, [pick_up]))
    await composition.receive(wish)
    async with composition.db.write() as tx:
        await tx.execute(text("UPDATE instructions SET mission_revision = 40"))

    for _ in range(3):
        await composition.replanner.step()
        composition.clock.advance(flight.planned_end_at - flight.planned_start_at)
        await composition.late_missions.step()

    codes = [row.code for row in await composition.rows("SELECT code FROM alarms")]
    assert codes.count("REVISIONS_REFUSED") == 1
    kinds = [report.kind for report in await composition.reports()]
    assert kinds.count("REPLANNING") == 1
