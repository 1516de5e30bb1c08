"""Missions at several stages: accepted, at the pickup, loaded."""

from collections.abc import Awaitable, Callable
from types import SimpleNamespace
from typing import Any

import pytest

#: Books a mission, brings its drone to a stage, and returns its instruction.
Begin = Callable[..., Awaitable[Any]]


async def accepted(
    composition: Any, drone: Any, make: Any, *destinations: str, loading: str = "AUTOMATIC"
) -> Any:
    """A mission that its drone has accepted and not begun."""
    await composition.book(
        make.candidate(loading=loading), request=make.request(*(destinations or ("c",)))
    )
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction))
    return instruction


async def at_pickup(composition: Any, drone: Any, make: Any, *destinations: str) -> Any:
    """A mission whose drone waits at the pickup for a loader."""
    instruction = await accepted(composition, drone, make, *destinations, loading="CONFIRMED")
    composition.clock.advance(instruction.steps[0].planned_start_at - composition.clock.now())
    await composition.receive(standing(drone, instruction))
    return instruction


async def loaded(composition: Any, drone: Any, make: Any, *destinations: str) -> Any:
    """A mission whose drone has its packages on board and has not taken off."""
    instruction = await accepted(composition, drone, make, *destinations)
    pick_up, *_ = drone.flown(instruction)
    drone.event_seq = 1
    composition.clock.advance(instruction.steps[0].planned_end_at - composition.clock.now())
    on_board = standing(
        drone,
        instruction,
        activity="WAITING",
        step_id=2,
        package_ids=[each.package_id for each in instruction.steps[0].packages],
    )
    await composition.receive(pick_up, on_board)
    return instruction


def standing(drone: Any, instruction: Any, **members: Any) -> Any:
    """The state of a drone that stands at the pickup to be loaded."""
    values = {
        "mission_id": instruction.mission_id,
        "mission_revision": instruction.mission_revision,
        "activity": "LOADING",
        "step_id": 1,
        "released_through": 1,
        **members,
    }
    return drone.state(**values)


@pytest.fixture
def begin() -> SimpleNamespace:
    """begin.accepted, begin.at_pickup, begin.loaded; begin.standing is such a drone's state."""
    return SimpleNamespace(accepted=accepted, at_pickup=at_pickup, loaded=loaded, standing=standing)
