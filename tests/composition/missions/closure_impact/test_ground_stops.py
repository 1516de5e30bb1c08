"""A ground stop affects missions once it forbids their next take-off."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.missions.closure_impact.impact import GroundStopEnforcer

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"
AROUND_B = [[0.15, -0.1], [0.2, -0.1], [0.2, 0.1], [0.15, 0.1], [0.15, -0.1]]
STOP = {"reason": "storm", "area": {"type": "Polygon", "coordinates": [AROUND_B]}}


async def fly_to_b(composition: Any, drone: Any) -> None:
    """Book a mission and let its drone fly: its next take-off is from b."""
    booking = await composition.book()
    (instruction,) = await composition.sent()
    flight = next(step for step in instruction.steps if step.kind == "FLY")
    await composition.receive(
        drone.ack(instruction),
        drone.state(
            activity="FLYING",
            mission_id=booking.missions[0].mission_id,
            mission_revision=1,
            step_id=flight.step_id,
            station_id=None,
            last_instruction_seq=1,
        ),
    )


async def trouble(composition: Any) -> str | None:
    (row,) = await composition.rows("SELECT trouble FROM missions")
    return None if row.trouble is None else str(row.trouble)


def enforcer(composition: Any) -> GroundStopEnforcer:
    return GroundStopEnforcer(composition.parts, composition.parts.closings)


async def test_a_mission_needs_another_plan_once_its_next_take_off_is_forbidden(
    composition: Any, drone: Any
) -> None:
    await composition(OPERATOR, "POST", "/v1/ground-stops", STOP)
    await fly_to_b(composition, drone)
    before = await trouble(composition)

    await enforcer(composition).step()

    assert before is None
    assert "GROUND_STOP" in (await trouble(composition) or "")


async def test_an_ended_ground_stop_changes_no_mission(composition: Any, drone: Any) -> None:
    until = composition.clock.now() + timedelta(minutes=1)
    await composition(OPERATOR, "POST", "/v1/ground-stops", STOP | {"until": until.isoformat()})
    made = await composition(OPERATOR, "POST", "/v1/ground-stops", STOP)
    await composition(OPERATOR, "DELETE", f"/v1/ground-stops/{made.json()['closure_id']}")
    await fly_to_b(composition, drone)
    composition.clock.advance(timedelta(minutes=1))

    await enforcer(composition).step()

    assert await trouble(composition) is None


async def test_a_mission_that_needs_a_plan_is_not_reported_again(
    composition: Any, drone: Any
) -> None:
    await fly_to_b(composition, drone)
    await composition(OPERATOR, "POST", "/v1/ground-stops", STOP)
    reports = len(await composition.reports())

    await enforcer(composition).step()

    assert len(await composition.reports()) == reports
