"""Calling off a mission while no package is on board."""

from datetime import timedelta
from typing import Any

A_DAY = timedelta(days=1)


def approach(steps: Any) -> Any:
    """A charge at home, a flight to the pickup, and loading there that a loader confirms."""
    return (
        steps()
        .recharge("home", until_soc=1.0, duration_s=3600)
        .fly("home", "over", length_m=6000, duration_s=300, lands=False)
        .fly("over", "shop", length_m=6000, duration_s=330)
        .pick_up("shop", awaits_confirmation=True, p1=0.5)
        .fly("shop", "home", length_m=8000, duration_s=430)
        .deliver("home", "p1")
    )


async def send_and_wait_for(world: Any, cloud: Any, steps: Any, activity: str) -> None:
    world.drone = world.drone.model_copy(update={"soc": 0.5})
    await world.start()
    await world.send(cloud.mission(approach(steps).made))
    await world.pass_until(lambda: world.states[-1].activity == activity)


async def test_a_mission_that_waits_for_its_load_can_be_called_off(
    world: Any, cloud: Any, steps: Any
) -> None:
    await send_and_wait_for(world, cloud, steps, "LOADING")

    await world.send(cloud.cancel())
    await world.pass_time(A_DAY)

    assert world.acks[-1].status == "ACCEPTED"
    cut = world.events[-1]
    assert (cut.event, cut.step_kind, cut.code) == ("STEP_ENDED", "PICK_UP", "CUT")
    assert (cut.package_ids, cut.data) == ((), {})
    assert world.states[-1].mission_id is None
    assert world.states[-1].package_ids == ()


async def test_a_cancelled_recharge_keeps_its_charge(world: Any, cloud: Any, steps: Any) -> None:
    await send_and_wait_for(world, cloud, steps, "RECHARGING")
    await world.pass_time(timedelta(seconds=900))

    await world.send(cloud.cancel())

    assert world.states[-1].mission_id is None
    assert world.states[-1].soc > 0.69
    assert world.states[-1].soc == world.events[-1].soc


async def test_a_cancelled_drone_lands_at_the_pickup_and_drops_the_mission(
    world: Any, cloud: Any, steps: Any
) -> None:
    await send_and_wait_for(world, cloud, steps, "FLYING")

    await world.send(cloud.cancel())
    assert world.acks[-1].status == "ACCEPTED"
    assert world.states[-1].mission_id == "msn_1"
    await world.pass_time(A_DAY)

    assert [event.step_id for event in world.events] == [1, 2, 3]
    assert (world.states[-1].mission_id, world.states[-1].station_id) == (None, "shop")


async def test_a_mission_that_is_called_off_takes_no_new_steps_but_the_next_mission_is_flown(
    world: Any, cloud: Any, steps: Any
) -> None:
    await send_and_wait_for(world, cloud, steps, "FLYING")
    await world.send(cloud.cancel())

    await world.send(cloud.divert(approach(steps).made[3:], last_valid_step=3))
    assert world.acks[-1].code == "STALE_REVISION"
    await world.pass_until(lambda: world.states[-1].mission_id is None)
    home = steps(at=world.clock.now()).fly("shop", "home", length_m=6000, duration_s=330)
    await world.send(cloud.mission(home.made, mission_id="msn_2"))
    await world.pass_until(lambda: world.is_over)

    assert world.events[-1].mission_id == "msn_2"


async def test_a_drone_that_is_held_is_called_off(world: Any, cloud: Any, steps: Any) -> None:
    await send_and_wait_for(world, cloud, steps, "FLYING")
    await world.send(cloud.hold())
    await world.pass_until(lambda: len(world.events) == 3)

    await world.send(cloud.cancel())

    assert world.states[-1].mission_id is None
    assert not world.states[-1].is_held
