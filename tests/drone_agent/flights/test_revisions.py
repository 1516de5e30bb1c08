"""A new revision replaces what is not released."""

from datetime import timedelta
from typing import Any

PRE_START = timedelta(minutes=10)


async def test_a_revision_replaces_what_is_not_released(
    world: Any, cloud: Any, trip: Any, steps: Any
) -> None:
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: any(state.activity == "FLYING" for state in world.states))

    home_from_shop = (
        steps(at=trip[3].planned_end_at, first_step=5)
        .fly("shop", "home", length_m=8000, duration_s=487)
        .bring_back("home", "p2")
    )
    await world.send(cloud.mission(home_from_shop.made, revision=2))
    await world.pass_until(lambda: world.is_over)

    kinds = [event.step_kind for event in world.events]
    assert kinds == ["PICK_UP", "FLY", "FLY", "DELIVER", "FLY", "RETURN", None]
    assert world.events[-1].mission_revision == 2
    assert world.states[-1].station_id == "home"
