"""What a drone does by itself when something goes wrong in flight: each row of the table acts."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.simulated.disturbances import Disturbances

#: A hundredth of a degree of longitude is so long at these stations' latitude.
HUNDREDTH_M = 963.0

PART = timedelta(seconds=60)


def longer(steps: Any) -> Any:
    """28.9 km to the farm with 1 kg, which leaves a quarter of a battery; then on to the shop."""
    trip = steps().pick_up("home", p1=1.0)
    trip.fly("home", "farm", length_m=30 * HUNDREDTH_M, duration_s=2000)
    trip.recharge("farm", until_soc=1.0, duration_s=9000)
    return trip.fly("farm", "shop", length_m=10 * HUNDREDTH_M, duration_s=700).deliver("shop", "p1")


async def fly(
    world: Any, cloud: Any, steps: Any, *, rate: float = 40.0, **disturbances: Any
) -> None:
    """On the way to the farm, looking out every ten seconds, or a quarter of `rate`."""
    world.clock.rate = rate
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


async def test_a_drone_that_can_reach_no_landing_lands_on_the_spot(
    world: Any, cloud: Any, steps: Any
) -> None:
    # Looked at so seldom that the way back is lost before the first alarm.
    await fly(world, cloud, steps, rate=600.0, flight_energy_factor=12.0)

    await world.pass_until(lambda: bool(failures(world)))

    down = world.states[-1]
    assert ("BATTERY_EMPTY", "CRITICAL") in [(one.code, one.level) for one in alarms(world)]
    failed = failures(world)[0]
    assert (failed.step_id, failed.code, failed.station_id) == (2, "BATTERY_EMPTY", None)
    assert (down.activity, down.station_id, down.package_ids) == ("DOWN", None, ("p1",))
    assert -98.0 < failed.position.longitude_deg < -97.7
    assert failed.position == down.position


@pytest.mark.parametrize(
    ("fault", "disturbances", "after_s"),
    [
        ("MOTOR_FAILURE", {"motor": {"share": 1.0, "after_s": 300}}, 300),
        ("GPS_LOST", {"gps": {"share": 1.0, "after_s": 300, "for_s": 600}}, 330),
    ],
)
async def test_a_drone_that_cannot_go_on_lands_on_the_spot(
    world: Any, cloud: Any, steps: Any, fault: str, disturbances: Any, after_s: float
) -> None:
    await fly(world, cloud, steps, **disturbances)

    await world.pass_until(lambda: bool(failures(world)))

    failed = failures(world)[0]
    assert (failed.code, failed.station_id) == (fault, None)
    assert [(alarm.code, alarm.level) for alarm in alarms(world)] == [(fault, "CRITICAL")]
    took_s = (failed.ended_at - failed.started_at).total_seconds()
    assert after_s + 30 <= took_s <= after_s + 30 + 25
    flown = (failed.position.longitude_deg + 98.0) / 0.01 * HUNDREDTH_M / 15.0
    assert flown == pytest.approx(took_s - 30, abs=5)
    assert world.states[-1].activity == "DOWN"


async def test_a_gps_that_is_back_in_time_changes_nothing(
    world: Any, cloud: Any, steps: Any
) -> None:
    await fly(world, cloud, steps, gps={"share": 1.0, "after_s": 300, "for_s": 25})

    await world.pass_until(lambda: len(world.events) == 2)

    assert (world.events[1].event, world.events[1].station_id) == ("STEP_ENDED", "farm")


async def test_a_drone_off_its_course_flies_straight_to_the_end_of_its_flight_and_goes_on(
    world: Any, cloud: Any, steps: Any
) -> None:
    # With this seed only the first of the ways strays.
    await fly(world, cloud, steps, seed=1, drift={"share": 0.5, "after_s": 60, "most_m": 600})

    await world.pass_until(lambda: any(one.step_id == 3 for one in world.events))

    strayed = alarms(world)[0]
    assert (strayed.code, strayed.data["off_course_m"] > 200) == ("GEOFENCE", True)
    turned = next(state for state in world.states if state.failsafe is not None)
    assert (turned.failsafe.failsafe, turned.failsafe.station_id) == ("DIVERT", "farm")
    landed = next(one for one in world.events if one.step_id == 2)
    assert (landed.event, landed.code, landed.station_id) == ("STEP_ENDED", None, "farm")
    assert landed.soc >= 0.1
    assert failures(world) == []
    assert world.states[-1].failsafe is None


async def test_a_drone_that_strays_again_flies_to_the_nearest_landing(
    world: Any, cloud: Any, steps: Any
) -> None:
    await fly(world, cloud, steps, drift={"share": 1.0, "after_s": 60, "most_m": 600})

    await world.pass_until(lambda: bool(failures(world)))

    led_to = [one.failsafe.station_id for one in world.states if one.failsafe is not None]
    assert list(dict.fromkeys(led_to)) == ["farm", "home"]
    assert {each.code for each in alarms(world)} == {"GEOFENCE"}
    assert (failures(world)[0].code, failures(world)[0].station_id) == ("GEOFENCE", "home")


async def test_a_drone_off_its_course_without_its_reserve_flies_to_the_nearest_landing(
    world: Any, cloud: Any, steps: Any
) -> None:
    strays = {"share": 1.0, "after_s": 60, "most_m": 600}
    await fly(world, cloud, steps, flight_energy_factor=1.25, drift=strays)

    await world.pass_until(lambda: any(one.failsafe is not None for one in world.states))

    turned = next(one for one in world.states if one.failsafe is not None)
    assert (turned.failsafe.fault, turned.failsafe.station_id) == ("GEOFENCE", "home")


async def test_a_drone_that_will_land_below_its_reserve_says_so_and_goes_on(
    world: Any, cloud: Any, steps: Any
) -> None:
    await fly(world, cloud, steps, flight_energy_factor=1.23)

    await world.pass_until(lambda: any(one.step_id == 2 for one in world.events))

    assert [(alarm.code, alarm.level) for alarm in alarms(world)] == [("BATTERY_LOW", "URGENT")]
    landed = next(one for one in world.events if one.step_id == 2)
    assert (landed.event, landed.station_id) == ("STEP_ENDED", "farm")
    assert 0.05 < landed.soc < 0.1
    await world.pass_time(timedelta(minutes=1))
    assert world.states[-1].faults == ()


@pytest.mark.parametrize(
    ("code", "level", "battery"),
    [
        ("BATTERY_COLD", "WARNING", {"temperature_c": -5.0}),
        ("CELL_IMBALANCE", "WARNING", {"worn_share": 1.0, "cell_spread_v": 0.2}),
    ],
)
async def test_a_battery_fault_raises_one_alarm(
    world: Any, cloud: Any, steps: Any, code: str, level: str, battery: Any
) -> None:
    world.clock.rate = 40.0
    world.disturbances = Disturbances.model_validate({"battery": battery})
    there = steps().fly("home", "over", length_m=10 * HUNDREDTH_M, duration_s=600)
    there.wait("over", duration_s=3000).fly("over", "home", length_m=9600, duration_s=600)
    await world.start()
    await world.send(cloud.mission(there.made))

    await world.pass_until(lambda: world.is_over)

    assert [(one.code, one.level) for one in alarms(world)] == [(code, level)]
    assert world.states[-1].faults == (code,)


async def test_a_hot_battery_keeps_the_drone_on_the_ground(
    world: Any, cloud: Any, steps: Any
) -> None:
    world.clock.rate = 40.0
    world.disturbances = Disturbances.model_validate({"battery": {"temperature_c": 65.0}})
    await world.start()
    await world.pass_time(timedelta(minutes=30))
    assert [(one.code, one.level) for one in alarms(world)] == [("BATTERY_HOT", "URGENT")]

    await world.send(cloud.mission(longer(steps).made))

    assert (world.acks[-1].status, world.acks[-1].code) == ("REJECTED", "FAILSAFE_ACTIVE")
    assert world.acks[-1].data == {"fault": "BATTERY_HOT"}


async def test_a_drone_waits_for_an_occupied_pad_and_then_asks_for_another_plan(
    world: Any, cloud: Any, steps: Any
) -> None:
    taken = {"station_id": "farm", "from_at": "2026-03-01T00:00:00Z"}
    taken["until_at"] = "2026-03-02T00:00:00Z"
    await fly(world, cloud, steps, pads={"taken": [taken]})

    await world.pass_until(lambda: bool(failures(world)))

    failed = failures(world)[0]
    assert [(one.code, one.level) for one in alarms(world)] == [("PAD_OCCUPIED", "WARNING")]
    assert (failed.step_kind, failed.code, failed.station_id) == (
        "RECHARGE",
        "PAD_OCCUPIED",
        "farm",
    )
    waited = failed.ended_at - failed.started_at
    assert timedelta(seconds=120) <= waited <= timedelta(seconds=140)
    landed = next(one for one in world.events if one.step_id == 2)
    assert failed.soc == landed.soc


async def test_a_pad_that_is_taken_all_of_a_short_reservation_fails_the_step_at_its_end(
    world: Any, cloud: Any, steps: Any
) -> None:
    trip = steps().pick_up("home", p1=1.0)
    trip.fly("home", "farm", length_m=30 * HUNDREDTH_M, duration_s=2000)
    trip.recharge("farm", until_soc=0.5, duration_s=60).deliver("farm", "p1")
    taken = {"station_id": "farm", "from_at": "2026-03-01T00:00:00Z"}
    taken["until_at"] = "2026-03-02T00:00:00Z"
    world.disturbances = Disturbances.model_validate({"pads": {"taken": [taken]}})
    await world.start()
    await world.send(cloud.mission(trip.made))

    await world.pass_until(lambda: bool(failures(world)))

    failed = failures(world)[0]
    assert (failed.step_kind, failed.code) == ("RECHARGE", "PAD_OCCUPIED")
    assert failed.ended_at == trip.made[2].not_after_at


async def test_a_pad_that_gets_free_in_time_is_charged_on(
    world: Any, cloud: Any, steps: Any
) -> None:
    trip = longer(steps).made
    taken = {"station_id": "farm", "from_at": "2026-03-01T00:00:00Z"}
    free_at = trip[2].planned_start_at + timedelta(seconds=60)
    taken["until_at"] = free_at.isoformat()
    await fly(world, cloud, steps, pads={"taken": [taken]})

    await world.pass_until(lambda: any(one.step_id == 3 for one in world.events))

    assert failures(world) == []
    assert world.events[-1].step_kind == "RECHARGE"
    assert world.events[-1].soc == 1.0 or world.events[-1].code == "SHORT_CHARGE"
