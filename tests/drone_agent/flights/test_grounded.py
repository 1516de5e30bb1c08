"""Faults that keep a drone on the ground, for as long as they last."""

from dataclasses import replace
from datetime import datetime
from typing import Any

import pytest
from skyway_drone_agent.simulated.disturbances import Disturbances, Drift
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle
from skyway_drone_agent.vehicle import Reading, Standing, StepRun

#: What the sensors show beside the truth.
SHOWN: dict[str, Any] = {}


class Troubled(SimulatedVehicle):
    """Its sensors show what the test says."""

    def read(self, doing: StepRun | Standing, at: datetime) -> Reading:
        return replace(super().read(doing, at), **SHOWN)


async def fly(world: Any, cloud: Any, trip: Any) -> None:
    """On the way to the shop."""
    SHOWN.clear()
    world.vehicle_type = Troubled
    world.clock.rate = 40.0
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: bool(world.states) and world.states[-1].activity == "FLYING")


def ended(world: Any) -> list[int]:
    return [event.step_id for event in world.events if event.event == "STEP_ENDED"]


@pytest.mark.parametrize(
    ("trouble", "fault", "stops_before", "failsafe"),
    [
        ({"temperature_c": 70.0}, "BATTERY_HOT", 4, "STAY"),
        ({"has_gps": False}, "GPS_LOST", 6, "LAND_AT_NEXT"),
        ({"has_battery": False}, "BATTERY_UNKNOWN", 6, "LAND_AT_NEXT"),
        ({"motors_work": False}, "MOTOR_FAILURE", 6, "LAND_AT_NEXT"),
    ],
)
async def test_a_grounded_drone_takes_off_when_the_fault_ends(
    world: Any,
    cloud: Any,
    trip: Any,
    trouble: dict[str, Any],
    fault: str,
    stops_before: int,
    failsafe: str,
) -> None:
    await fly(world, cloud, trip)
    if fault == "BATTERY_HOT":
        SHOWN.update(trouble)
    else:
        await world.pass_until(lambda: world.states[-1].activity == "DELIVERING")
        SHOWN.update(trouble)
    await world.pass_time(3 * (trip[-1].planned_end_at - trip[0].planned_start_at))

    assert ended(world) == list(range(1, stops_before))
    assert (world.states[-1].faults, world.states[-1].failsafe.failsafe) == ((fault,), failsafe)

    over_at = world.clock.now()
    SHOWN.clear()
    await world.pass_until(lambda: stops_before in [event.step_id for event in world.events])

    begun = next(event for event in world.events if event.step_id == stops_before)
    assert begun.started_at >= over_at
    assert [one.code for one in world.events if one.event == "ALARM"] == [fault]


async def test_a_drone_that_cannot_take_off_accepts_no_mission(
    world: Any, cloud: Any, trip: Any
) -> None:
    SHOWN.clear()
    SHOWN["motors_work"] = False
    world.vehicle_type = Troubled
    await world.start()

    await world.send(cloud.mission(trip))
    assert world.acks[-1].code == "FAILSAFE_ACTIVE"
    SHOWN.clear()
    await world.pass_until(lambda: world.states[-1].faults == ())
    await world.send(cloud.mission(trip))

    assert world.acks[-1].status == "ACCEPTED"


async def test_an_override_on_the_ground_lets_the_drone_take_off(
    world: Any, cloud: Any, trip: Any, steps: Any
) -> None:
    await fly(world, cloud, trip)
    await world.pass_until(lambda: world.states[-1].activity == "DELIVERING")
    SHOWN["has_gps"] = False
    await world.pass_until(lambda: "GPS_LOST" in world.states[-1].faults)

    back = steps(at=world.clock.now(), first_step=5)
    back.fly("shop", "home", length_m=8000, duration_s=500).bring_back("home", "p2")
    await world.send(cloud.divert(back.made, overrides_failsafe=True))
    await world.pass_until(lambda: world.is_over)

    # The recharge that the new steps cut, and they.
    assert ended(world) == [1, 2, 3, 4, 5, 5, 6]


async def test_a_landing_on_the_spot_is_begun_once_however_long_the_fault_lasts(
    world: Any, cloud: Any, trip: Any
) -> None:
    await fly(world, cloud, trip)

    SHOWN["motors_work"] = False
    await world.pass_until(lambda: world.states[-1].activity == "DOWN")

    assert world.trace.count("journal FAILSAFE") == 1
    assert world.events[-1].code == "MOTOR_FAILURE"


async def test_after_a_failed_flight_no_later_step_is_released(
    world: Any, cloud: Any, trip: Any, steps: Any
) -> None:
    world.disturbances = Disturbances(drift=Drift(share=1.0, after_s=60, most_m=900))
    await fly(world, cloud, trip)
    assert world.states[-1].released_through == 3

    await world.pass_until(lambda: world.events[-1].event == "STEP_FAILED")
    assert (world.events[-1].code, world.events[-1].step_id) == ("GEOFENCE", 2)

    home = steps(at=world.clock.now(), first_step=3).bring_back("home", "p1", "p2")
    await world.send(cloud.mission(home.made, revision=2))
    await world.pass_until(lambda: world.is_over)

    assert world.acks[-1].status == "ACCEPTED"
