"""A mission whose drone has failed at a step, what its drone says then, and its alarms."""

from typing import Any

from skyway.contracts.drone_report import DroneHealth


async def failed_at(
    composition: Any, drone: Any, failing: int, station_id: str | None, code: str, **members: Any
) -> Any:
    """The first instruction, after all steps before this one ended and this one failed."""
    await composition.book()
    (instruction,) = await composition.sent()
    before = drone.flown(instruction)[: failing - 1]
    drone.event_seq = failing - 1
    step = instruction.steps[failing - 1]
    composition.clock.advance(step.planned_start_at - composition.clock.now())
    failure = drone.event(
        "STEP_FAILED",
        mission_id=instruction.mission_id,
        mission_revision=1,
        step_id=failing,
        step_kind=step.kind,
        station_id=station_id,
        code=code,
        **members,
    )
    await composition.receive(drone.ack(instruction), *before, failure)
    return instruction


def health(consumption_factor: float, *, charging: float | None = None) -> DroneHealth:
    return DroneHealth(
        voltage_v=44.0,
        current_a=10.0,
        soc_error=0.01,
        cell_spread_v=0.01,
        temperature_c=20.0,
        state_of_health=1.0,
        consumption_factor=consumption_factor,
        charge_rate_factor=charging,
        range_m=10_000.0,
    )


async def alarms(composition: Any) -> list[Any]:
    answer = await composition("operator:op", "GET", "/v1/alarms")
    return list(answer.json()["items"])


def stands_at_b(drone: Any, mission: Any, **fields: Any) -> Any:
    """The state of a drone that stands at b with its package, before the flight of step 4."""
    return drone.state(
        mission_id=mission.mission_id,
        mission_revision=1,
        activity="WAITING",
        step_id=4,
        station_id="b",
        package_ids=("p1",),
        **fields,
    )
