"""A mission without a plan ends only while its drone surely does not load its packages."""

from datetime import timedelta
from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"


async def accepted_mission(composition: Any, drone: Any, make: Any) -> Any:
    """The instruction of a mission that its drone has accepted and not begun."""
    await composition.book(make.candidate())
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction))
    return instruction


async def close_destination(composition: Any) -> None:
    for station_id in ("b", "c"):
        path = f"/v1/stations/{station_id}/closures"
        answer = await composition(OPERATOR, "POST", path, {"reason": "a storm"})
        assert answer.is_success, answer.text


async def test_a_mission_that_may_be_loading_is_not_cancelled(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction = await accepted_mission(composition, drone, make)
    composition.clock.advance(instruction.steps[0].planned_start_at - composition.clock.now())

    await close_destination(composition)
    await composition.replanner.step()

    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"
    assert [each.kind for each in await composition.sent()] == []


async def test_a_mission_that_starts_minutes_later_is_cancelled(
    composition: Any, drone: Any, make: Any
) -> None:
    at = composition.clock.now() + timedelta(minutes=9)
    await composition.book(request=make.request("c", earliest_pickup_at=at))
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction))

    await close_destination(composition)
    await composition.replanner.step()
    before = await composition.state_of(instruction.mission_id)
    (call_off,) = await composition.sent()
    await composition.receive(drone.ack(call_off))

    assert (before, call_off.kind) == ("ACCEPTED", "CANCEL")
    assert await composition.state_of(instruction.mission_id) == "CANCELLED"
