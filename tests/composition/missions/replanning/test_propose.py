"""A revision for a flying drone becomes its plan once the drone has accepted it."""

import json
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.missions.mission.record import Trouble
from skyway_composition.missions.mission.standby import pads_of
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.check_plan import request_plan

from skyway.contracts.flight_step import FlyStep, RechargeStep
from skyway.ids import DroneId
from skyway.units import moment_to_ms

pytestmark = pytest.mark.databases("sqlite")

HEALTH = {
    "voltage_v": 22.0,
    "current_a": 1.0,
    "soc_error": 0.01,
    "cell_spread_v": 0.01,
    "temperature_c": 20.0,
    "state_of_health": 1.0,
    "range_m": 10_000.0,
}
LATE_WIND = Trouble(code="PLAN_WANTED", detail="the wind has turned")


async def flying(composition: Any, drone: Any) -> Any:
    """The instruction of a drone on its first flight, with the packages on board."""
    await composition.book()
    (instruction,) = await composition.sent()
    pick_up, flight = instruction.steps[:2]
    assert isinstance(flight, FlyStep)
    composition.clock.advance(pick_up.planned_end_at - composition.clock.now())
    await composition.receive(
        drone.ack(instruction),
        *drone.ended(instruction, [pick_up]),
        flying_state(drone, instruction, flight.step_id),
    )
    return instruction


def flying_state(drone: Any, instruction: Any, step_id: int) -> Any:
    return drone.state(
        mission_id=instruction.mission_id,
        mission_revision=instruction.mission_revision,
        activity="FLYING",
        step_id=step_id,
        released_through=step_id,
        station_id=None,
        package_ids=("p1",),
    )


async def trouble(composition: Any, why: Trouble = LATE_WIND) -> None:
    async with composition.db.write() as tx:
        work = await MissionUnitOfWork.lock(composition.parts, tx, [DroneId("drn_1")])
        await request_plan(work, work.missions[DroneId("drn_1")], why)


async def proposed(composition: Any, drone: Any) -> tuple[Any, Any]:
    """The instruction that the drone flies, and the proposal to replace it."""
    first = await flying(composition, drone)
    await trouble(composition)
    await composition.replanner.step()
    (proposal,) = await composition.sent()
    return first, proposal


def windows(instruction: Any) -> list[tuple[str, int, int, int]]:
    """The pads of an instruction's steps as they are reserved, with the gap of 120 s."""
    return [
        (each.station_id, each.pad, each.start_ms, each.end_ms)
        for each in pads_of(instruction.steps, pad_gap_s=120.0)
    ]


def is_held(window: tuple[str, int, int, int], rows: Any) -> bool:
    station_id, pad, start_ms, end_ms = window
    return any(
        (row.station_id, row.pad) == (station_id, pad)
        and row.start_ms <= start_ms
        and row.end_ms >= end_ms
        for row in rows
    )


async def trouble_code(composition: Any) -> Any:
    (row,) = await composition.rows("SELECT trouble FROM missions")
    return json.loads(row.trouble or "{}").get("code")


async def steps_planned(composition: Any) -> list[int]:
    rows = await composition.rows(
        "SELECT step_id FROM mission_steps WHERE status = 'PLANNED' ORDER BY step_id"
    )
    return [row.step_id for row in rows]


async def test_a_flying_drone_is_sent_a_plan_from_its_next_landing(
    composition: Any, drone: Any
) -> None:
    first, proposal = await proposed(composition, drone)

    assert (proposal.kind, proposal.mission_revision) == ("MISSION", 2)
    assert (proposal.first_step, proposal.steps[0].step_id) == (3, 3)
    assert proposal.steps[0].station_id == first.steps[1].to_id
    kinds = [report.kind for report in await composition.reports()]
    assert kinds[-1] == "REPLANNING"


async def test_the_pads_of_both_plans_are_reserved_until_the_drone_answers(
    composition: Any, drone: Any
) -> None:
    first, proposal = await proposed(composition, drone)

    rows = await composition.reservations()
    needed = [*windows(first), *windows(proposal)]
    assert windows(first) != windows(proposal)
    assert [window for window in needed if not is_held(window, rows)] == []
    assert await steps_planned(composition) == [step.step_id for step in first.steps[1:]]
    assert await composition.broken() == []


async def test_an_accepted_proposal_becomes_the_plan(composition: Any, drone: Any) -> None:
    _, proposal = await proposed(composition, drone)

    await composition.receive(drone.ack(proposal))

    rows = await composition.reservations()
    assert [tuple(row)[:4] for row in rows] == windows(proposal)
    assert await steps_planned(composition) == [2, *(step.step_id for step in proposal.steps)]
    report = (await composition.reports())[-1]
    assert (report.kind, report.code, report.mission.revision) == ("REPLANNED", "PLAN_WANTED", 2)
    assert await composition.broken() == []
    await composition.replanner.step()
    assert await composition.sent() == []


async def test_a_rejected_proposal_leaves_the_mission_as_it_was(
    composition: Any, drone: Any
) -> None:
    first, proposal = await proposed(composition, drone)

    await composition.receive(drone.ack(proposal, "REJECTED", code="STEP_RELEASED"))

    rows = await composition.reservations()
    assert [tuple(row)[:4] for row in rows] == windows(first)
    assert await steps_planned(composition) == [step.step_id for step in first.steps[1:]]
    assert await composition.broken() == []


async def test_after_a_rejection_another_plan_begins_where_the_drone_reports(
    composition: Any, drone: Any
) -> None:
    first, proposal = await proposed(composition, drone)
    recharge = first.steps[2]
    assert isinstance(recharge, RechargeStep)
    composition.clock.advance(recharge.planned_start_at - composition.clock.now())
    charging = drone.state(
        mission_id=first.mission_id,
        activity="RECHARGING",
        step_id=3,
        released_through=3,
        station_id="b",
        soc=0.4,
        package_ids=("p1",),
    )

    await composition.receive(
        drone.ack(proposal, "REJECTED", code="STEP_RELEASED"),
        *drone.ended(first, [first.steps[1]]),
        charging,
    )
    await composition.replanner.step()

    (another,) = await composition.sent()
    assert (another.kind, another.mission_revision) == ("DIVERT", 3)
    assert (another.last_valid_step, another.steps[0].step_id) == (2, 3)
    now_ms = moment_to_ms(composition.clock.now())
    assert moment_to_ms(another.steps[0].planned_start_at) > now_ms


async def diverted_from_its_pad(composition: Any, drone: Any) -> tuple[Any, Any]:
    """The first instruction, and the DIVERT that cuts the drone's present recharge."""
    first, proposal = await proposed(composition, drone)
    await composition.receive(
        drone.ack(proposal, "REJECTED", code="STEP_RELEASED"),
        *drone.ended(first, [first.steps[1]]),
        at_its_pad(drone, first),
    )
    await composition.replanner.step()
    (divert,) = await composition.sent()
    return first, divert


def at_its_pad(drone: Any, instruction: Any, **members: Any) -> Any:
    values = {
        "mission_id": instruction.mission_id,
        "mission_revision": instruction.mission_revision,
        "activity": "RECHARGING",
        "step_id": 3,
        "released_through": 3,
        "station_id": "b",
        "soc": 0.4,
        "package_ids": ("p1",),
        **members,
    }
    return drone.state(**values)


def cut(drone: Any, step: Any, instruction: Any) -> Any:
    (ended,) = drone.ended(instruction, [step])
    message = ended.message.model_copy(update={"code": "CUT"})
    return type(ended)(ended.topic, ended.ids, message, retained=False)


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_cut_recharge_does_not_end_the_new_step_with_its_number(
    composition: Any, drone: Any
) -> None:
    first, divert = await diverted_from_its_pad(composition, drone)

    await composition.receive(drone.ack(divert), cut(drone, first.steps[2], first))

    assert await steps_planned(composition) == [step.step_id for step in divert.steps]
    assert await composition.broken() == []


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_change_during_a_proposal_is_checked_against_the_new_plan(
    composition: Any, drone: Any
) -> None:
    first, divert = await diverted_from_its_pad(composition, drone)
    in_wind = {"health": HEALTH | {"consumption_factor": 1.6}}
    await composition.receive(at_its_pad(drone, first, **in_wind))
    assert await trouble_code(composition) == "PLAN_WANTED"

    await composition.receive(
        drone.ack(divert),
        cut(drone, first.steps[2], first),
        at_its_pad(drone, divert, activity="WAITING", released_through=2, **in_wind),
    )

    assert await trouble_code(composition) == "MORE_ENERGY"


@pytest.mark.databases("sqlite", "postgresql")
@pytest.mark.parametrize("first_message", ["state", "event"])
async def test_a_report_with_the_proposed_revision_accepts_the_proposal(
    composition: Any, drone: Any, first_message: str
) -> None:
    first, proposal = await proposed(composition, drone)
    landed = drone.ended(first, [first.steps[1]])
    on_pad = at_its_pad(drone, proposal, activity="WAITING", released_through=2)
    lost = drone.event(
        "STEP_FAILED",
        mission_id=proposal.mission_id,
        mission_revision=2,
        step_id=3,
        station_id="b",
        code="PAD_LOST",
    )

    # Its answer was lost: the drone answers again when the proposal is repeated.
    await composition.receive(*landed, *([on_pad] if first_message == "state" else []), lost)
    await composition.receive(drone.ack(proposal))

    assert [each.kind for each in await composition.reports()].count("REPLANNED") == 1
    (row,) = await composition.rows("SELECT stuck FROM missions")
    assert "PAD_LOST" in (row.stuck or "")
    await composition.replanner.step()
    assert [each.mission_revision for each in await composition.sent()] == [3]
    assert await composition.broken() == []


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_state_of_the_proposed_revision_accepts_the_proposal(
    composition: Any, drone: Any
) -> None:
    first, proposal = await proposed(composition, drone)
    on_pad = at_its_pad(drone, proposal, activity="WAITING", released_through=2)

    await composition.receive(*drone.ended(first, [first.steps[1]]), on_pad)

    (row,) = await composition.rows("SELECT proposal FROM missions")
    assert row.proposal is None
    assert [each.kind for each in await composition.reports()].count("REPLANNED") == 1
    assert await composition.broken() == []


async def test_a_newer_trouble_is_planned_after_the_answer(composition: Any, drone: Any) -> None:
    _, proposal = await proposed(composition, drone)
    await trouble(composition, Trouble(code="STATION_CLOSED", detail="c is closed"))

    await composition.replanner.step()
    assert [each.mission_revision for each in await composition.sent()] == [2]
    await composition.receive(drone.ack(proposal))
    await composition.replanner.step()

    assert [each.mission_revision for each in await composition.sent()] == [3]


async def test_a_recharge_that_ends_early_releases_its_pad_after_the_gap(
    composition: Any, drone: Any
) -> None:
    first = await flying(composition, drone)
    flight, recharge = first.steps[1:3]
    early = timedelta(minutes=10)

    await composition.receive(*drone.ended(first, [flight]))
    await composition.receive(*drone.ended(first, [recharge], late_by=-early))

    held_until = [
        row.end_ms
        for row in await composition.reservations()
        if row.start_ms == moment_to_ms(recharge.not_before_at)
    ]
    left_at = recharge.planned_end_at - early
    assert held_until == [moment_to_ms(left_at + timedelta(seconds=120))]
    assert await composition.broken() == []
