"""What a drone does by itself when something goes wrong in flight: each row of the table acts."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.disturbances import Disturbances

#: A hundredth of a degree of longitude is so long at these stations' latitude.
HUNDREDTH_M = 963.0

PART = timedelta(seconds=60)


def longer(steps: Any) -> Any:
    """28.9 km to the farm with 1 kg, which leaves a quarter of a battery; then on to the shop."""
    trip = steps().pick_up("home", p1=1.0)
    trip.fly("home", "farm", length_m=30 * HUNDREDTH_M, duration_s=2000)
    trip.recharge("farm", until_soc=1.0, duration_s=9000)
    return trip.fly("farm", "shop", length_m=10 * HUNDREDTH_M, duration_s=700).deliver("shop", "p1")


async def fly(world: Any, cloud: Any, steps: Any, **disturbances: Any) -> None:
    """On the way to the farm, looking out every ten seconds."""
    world.clock.rate = 40.0
    world.disturbances = Disturbances.model_validate(disturbances)
    await world.start()
    await world.send(cloud.mission(longer(steps).made))
    await world.pass_until(lambda: is_flying(world))


def is_flying(world: Any) -> bool:
    return bool(world.states) and world.states[-1].activity == "FLYING"


def alarms(world: Any) -> list[Any]:
    return [event for event in world.events if event.event == "ALARM"]


def failures(world: Any) -> list[Any]:
    return [event for event in world.events if event.event == "STEP_FAILED"]


async def test_a_short_battery_takes_the_drone_to_the_landing_where_most_is_left(
    world: Any, cloud: Any, steps: Any
) -> None:
    await fly(world, cloud, steps, flight_energy_factor=1.4)

    await world.pass_until(lambda: bool(failures(world)))

    short = next(alarm for alarm in alarms(world) if alarm.code == "BATTERY_SHORT")
    assert (short.level, short.step_id, short.mission_id) == ("CRITICAL", None, "msn_1")
    assert short.data["soc_at_landing"] < 0.05
    turned = next(state for state in world.states if state.failsafe is not None)
    assert turned.failsafe.model_dump(mode="json") == {
        "fault": "BATTERY_SHORT",
        "failsafe": "DIVERT",
        "station_id": "home",
    }
    failed = failures(world)[0]
    assert (failed.step_id, failed.code, failed.station_id) == (2, "BATTERY_SHORT", "home")
    assert (world.states[-1].activity, world.states[-1].station_id) == ("WAITING", "home")
    assert world.states[-1].package_ids == ("p1",)
    assert failed.soc == pytest.approx(1.0 - failed.energy_j / 360_000)
    assert failed.started_at == world.events[0].ended_at


async def test_after_a_divert_the_clouds_new_plan_is_flown_from_there(
    world: Any, cloud: Any, steps: Any
) -> None:
    await fly(world, cloud, steps, flight_energy_factor=1.4)
    await world.pass_until(lambda: bool(failures(world)))

    again = steps(at=world.clock.now(), first_step=3)
    again.recharge("home", until_soc=1.0, duration_s=9000)
    again.fly("home", "shop", length_m=20 * HUNDREDTH_M, duration_s=1400).deliver("shop", "p1")
    await world.send(cloud.mission(again.made, revision=2))
    await world.pass_until(lambda: world.is_over)

    assert (world.acks[-1].status, world.acks[-1].code) == ("ACCEPTED", None)
    ends = [(one.step_id, one.code) for one in world.events if one.event != "ALARM"]
    assert ends == [(1, None), (2, "BATTERY_SHORT"), (3, None), (4, None), (5, None), (None, None)]
    assert world.states[-1].faults == ()
