"""A drone waits for its loader for a limited time."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.missions.timeouts import LoadingTimeouts

pytestmark = pytest.mark.databases("sqlite")

#: Half an hour, unless the network says otherwise.
TIMEOUT = timedelta(seconds=1_800)


async def sweep(composition: Any) -> None:
    parts = composition.parts
    await LoadingTimeouts(parts).step()


async def test_a_drone_without_a_loader_becomes_free_again(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)

    composition.clock.advance(TIMEOUT)
    await sweep(composition)

    report = (await composition.reports())[-1]
    assert (report.kind, report.code) == ("ENDED", "LOADING_TIMEOUT")
    assert await composition.state_of(instruction.mission_id) == "CANCELLED"
    assert (await composition.sent())[-1].kind == "CANCEL"
    assert await composition.reservations() == []
    assert await composition.broken() == []


async def test_a_loader_has_the_time_that_the_network_sets(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)

    composition.clock.advance(TIMEOUT - timedelta(milliseconds=1))
    await sweep(composition)

    assert await composition.state_of(instruction.mission_id) == "ACTIVE"


async def test_on_a_fast_clock_a_loader_has_ten_wall_seconds(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)
    composition.clock.rate = 1_200.0

    composition.clock.advance(timedelta(seconds=9.9 * composition.clock.rate))
    await sweep(composition)
    in_time = await composition.state_of(instruction.mission_id)
    composition.clock.advance(timedelta(seconds=0.1 * composition.clock.rate))
    await sweep(composition)

    assert in_time == "ACTIVE"
    assert await composition.state_of(instruction.mission_id) == "CANCELLED"


async def test_the_loading_timeout_begins_when_the_drone_arrives(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    await composition.book(make.candidate(loading="CONFIRMED", station_id="b"))
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction))
    late = timedelta(hours=1)
    pickup = next(step for step in instruction.steps if step.kind == "PICK_UP")
    approach = [
        drone.event(
            "STEP_ENDED",
            mission_id=instruction.mission_id,
            step_id=step.step_id,
            started_at=step.planned_start_at,
            ended_at=step.planned_end_at + late,
        )
        for step in instruction.steps[: pickup.step_id - 1]
    ]
    composition.clock.advance(pickup.planned_start_at + late - composition.clock.now())
    await composition.receive(*approach, begin.standing(drone, instruction, step_id=pickup.step_id))

    composition.clock.advance(TIMEOUT - timedelta(seconds=1))
    await sweep(composition)
    in_time = await composition.state_of(instruction.mission_id)
    composition.clock.advance(timedelta(seconds=1))
    await sweep(composition)

    assert in_time == "ACTIVE"
    assert await composition.state_of(instruction.mission_id) == "CANCELLED"


async def test_a_drone_that_never_arrived_does_not_time_out(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make, loading="CONFIRMED")

    composition.clock.advance(2 * TIMEOUT)
    await sweep(composition)

    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"


async def test_a_loading_confirmed_in_time_does_not_time_out(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)
    body = {"packages": [{"package_id": "p1", "mass_kg": 0.4}]}
    await composition(
        "provider:prv_1", "POST", f"/v1/missions/{instruction.mission_id}/loading", body
    )

    composition.clock.advance(TIMEOUT)
    await sweep(composition)

    assert await composition.state_of(instruction.mission_id) == "ACTIVE"


async def test_a_held_drone_does_not_time_out(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)
    await composition(
        "operator:op",
        "POST",
        f"/v1/missions/{instruction.mission_id}/commands",
        {"command": "HOLD", "reason": "a crowd"},
    )

    composition.clock.advance(TIMEOUT)
    await sweep(composition)

    assert await composition.state_of(instruction.mission_id) == "ACTIVE"
