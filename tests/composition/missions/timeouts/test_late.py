"""A late drone may meet closures that begin after its planned time."""

from datetime import datetime, timedelta
from typing import Any

import pytest

from skyway.contracts.flight_step import FlyStep

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

#: With twice the scenario's battery a drone can fly on over b, or back.
FOR_TWO_FLIGHTS_J = 1_800_000.0
B_DEG = 0.17986


async def take_off_for_b(
    composition: Any, drone: Any, make: Any, **model_members: Any
) -> tuple[Any, FlyStep]:
    """The instruction of a drone that flies to b, and this flight."""
    candidate = make.candidate()
    members = {"battery_j": FOR_TWO_FLIGHTS_J, **model_members}
    model = candidate.model.model_copy(update=members)
    await composition.book(candidate.model_copy(update={"model": model}), request=make.request("b"))
    (instruction,) = await composition.sent()
    pick_up, flight, *_ = instruction.steps
    composition.clock.advance(pick_up.planned_end_at - composition.clock.now())
    await composition.receive(
        drone.ack(instruction), *drone.ended(instruction, [pick_up]), flying(drone, instruction)
    )
    return instruction, flight


def flying(drone: Any, instruction: Any, **members: Any) -> Any:
    values = {
        "mission_id": instruction.mission_id,
        "mission_revision": instruction.mission_revision,
        "activity": "FLYING",
        "step_id": 2,
        "released_through": 2,
        "station_id": None,
        "package_ids": ("p1",),
        "soc": 1.0,
        **members,
    }
    return drone.state(**values)


async def close(composition: Any, from_at: datetime) -> None:
    body = {"reason": "a storm", "from_at": from_at.isoformat()}
    answer = await composition("operator:op", "POST", "/v1/stations/b/closures", body)
    assert answer.status_code == 201, answer.text


async def reports_of(composition: Any) -> list[str | None]:
    reports = await composition.reports()
    return [each.code for each in reports if each.kind == "REPLANNING"]


async def test_a_drone_that_would_arrive_after_a_closure_gets_another_plan(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction, flight = await take_off_for_b(composition, drone, make)
    await close(composition, flight.planned_end_at + timedelta(minutes=5))
    assert await reports_of(composition) == []
    composition.clock.advance(
        flight.planned_end_at + timedelta(minutes=1) - composition.clock.now()
    )
    # Half of the flight, a third of an hour, lies ahead.
    await composition.receive(flying(drone, instruction, position=(B_DEG / 2, 0.0)))

    await composition.late_missions.step()
    await composition.replanner.step()

    assert await reports_of(composition) == ["LATE"]
    (divert,) = await composition.sent()
    assert (divert.kind, divert.last_valid_step) == ("DIVERT", 2)
    assert divert.steps[0].kind == "FLY"


async def test_a_late_drone_that_still_arrives_in_time_keeps_its_plan(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction, flight = await take_off_for_b(composition, drone, make)
    await close(composition, flight.planned_end_at + timedelta(minutes=5))
    composition.clock.advance(
        flight.planned_end_at + timedelta(minutes=1) - composition.clock.now()
    )
    await composition.receive(flying(drone, instruction, position=(0.95 * B_DEG, 0.0)))

    await composition.late_missions.step()

    assert await reports_of(composition) == []


async def test_a_landing_planned_at_a_closed_station_is_no_new_trouble(
    composition: Any, drone: Any, make: Any
) -> None:
    """With half the battery the drone reaches no other station."""
    _, flight = await take_off_for_b(composition, drone, make, battery_j=FOR_TWO_FLIGHTS_J / 2)
    await close(composition, composition.clock.now())
    await composition.replanner.step()
    (revision,) = await composition.sent()
    await composition.receive(drone.ack(revision))
    late_at = flight.planned_end_at + timedelta(minutes=5)
    composition.clock.advance(late_at - composition.clock.now())

    await composition.late_missions.step()

    assert [each.kind for each in revision.steps] == ["RETURN"]
    assert await reports_of(composition) == ["STATION_CLOSED"]
