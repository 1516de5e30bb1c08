"""A new revision replaces the steps that are not released."""

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


async def fail_at_shop(world: Any, cloud: Any, steps: Any) -> None:
    """A flight whose pad is lost on arrival."""
    trip = (
        steps()
        .fly("home", "shop", length_m=8000, duration_s=430)
        .recharge("shop", until_soc=1.0, duration_s=0)
        .fly("shop", "home", length_m=8000, duration_s=430)
    )
    await world.start()
    await world.send(cloud.mission(trip.made))
    await world.pass_until(lambda: len(world.events) == 2)
    assert world.events[-1].code == "PAD_LOST"


async def test_after_a_failure_nothing_of_the_old_plan_is_flown(
    world: Any, cloud: Any, steps: Any
) -> None:
    await fail_at_shop(world, cloud, steps)

    on = steps(at=world.clock.now(), first_step=4).fly("shop", "farm", length_m=1, duration_s=31)
    await world.send(cloud.mission(on.made, revision=2))
    await world.pass_until(lambda: world.is_over)

    assert [event.step_id for event in world.events] == [1, 2, 4, None]
    assert world.states[-1].station_id == "farm"


async def test_no_step_of_a_revision_begins_before_it_was_accepted(
    world: Any, cloud: Any, steps: Any
) -> None:
    await fail_at_shop(world, cloud, steps)
    planned_at = world.clock.now()
    await world.pass_time(timedelta(seconds=900))
    accepted_at = world.clock.now()

    on = steps(at=planned_at, first_step=2).fly("shop", "farm", length_m=1, duration_s=31)
    await world.send(cloud.mission(on.made, revision=2))
    await world.pass_until(lambda: world.is_over)

    assert world.events[2].started_at == accepted_at


async def test_a_revision_of_a_mission_that_is_over_is_refused(
    world: Any, cloud: Any, trip: Any
) -> None:
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: world.is_over)

    await world.send(cloud.mission(trip, revision=2))

    assert (world.acks[-1].status, world.acks[-1].code) == ("REJECTED", "STALE_REVISION")
