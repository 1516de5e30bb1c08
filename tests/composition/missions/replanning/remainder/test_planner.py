"""After a change of plan a drone still stands by where its setting sends it."""

from typing import Any

import pytest

from skyway.contracts.flight_step import FlyStep

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"


async def in_flight(composition: Any, drone: Any, make: Any, **members: Any) -> Any:
    """The instruction of a drone on its first flight from a to c; its home is e."""
    candidate = make.candidate(home_station_id="e", **members)
    await composition.book(candidate, request=make.request("c"))
    (instruction,) = await composition.sent()
    pick_up, flight = instruction.steps[:2]
    assert isinstance(flight, FlyStep)
    composition.clock.advance(pick_up.planned_end_at - composition.clock.now())
    state = drone.state(
        mission_id=instruction.mission_id,
        mission_revision=instruction.mission_revision,
        activity="FLYING",
        step_id=flight.step_id,
        released_through=flight.step_id,
        station_id=None,
        package_ids=("p1",),
    )
    await composition.receive(drone.ack(instruction), *drone.ended(instruction, [pick_up]), state)
    return instruction


async def replanned(composition: Any) -> Any:
    """The last instruction with steps, after a round of replanning."""
    await composition.replanner.step()
    return [each for each in await composition.sent() if hasattr(each, "steps")][-1]


async def test_a_drone_that_stays_charges_where_it_brings_its_packages_back(
    composition: Any, drone: Any, make: Any
) -> None:
    await in_flight(composition, drone, make, standby="STAY")

    await composition(OPERATOR, "POST", "/v1/stations/c/closures", {"reason": "a storm"})
    revision = await replanned(composition)

    *_, returned, last = revision.steps
    assert (returned.kind, returned.station_id) == ("RETURN", "a")
    assert (last.kind, last.station_id) == ("RECHARGE", "a")


@pytest.mark.parametrize("standby", ["HOME", "STAY", "PARKING"])
async def test_a_drone_that_is_called_home_goes_home_under_every_setting(
    composition: Any, drone: Any, make: Any, standby: str
) -> None:
    instruction = await in_flight(composition, drone, make, standby=standby)

    path = f"/v1/missions/{instruction.mission_id}/commands"
    answer = await composition(
        OPERATOR, "POST", path, {"command": "RETURN_HOME", "reason": "the end of the day"}
    )
    revision = await replanned(composition)

    assert answer.status_code == 202, answer.text
    assert (revision.steps[-1].kind, revision.steps[-1].station_id) == ("RECHARGE", "e")
