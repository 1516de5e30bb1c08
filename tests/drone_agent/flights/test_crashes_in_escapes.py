"""After a crash around a failsafe the next process continues it and does nothing twice."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.journal.records import Placed
from skyway_drone_agent.simulated.disturbances import Disturbances

from skyway.geo import Position
from skyway.ids import StationId
from tests.long_cases import sampled

SHORT = {"flight_energy_factor": 1.4}
BROKEN = {"motor": {"share": 1.0, "after_s": 200}}


def plan(steps: Any) -> Any:
    trip = steps().pick_up("home", p1=1.0)
    trip.fly("home", "farm", length_m=28_900, duration_s=2000)
    trip.recharge("farm", until_soc=1.0, duration_s=9000)
    return trip.fly("farm", "shop", length_m=9_600, duration_s=700).deliver("shop", "p1")


def has_failed(world: Any) -> bool:
    return any(event.event == "STEP_FAILED" for event in world.events)


async def survive(world: Any, last_word: Any) -> None:
    """Start the agent again if it has died; the cloud repeats its last word."""
    if world.has_died:
        world.journal.dies_before = world.journal.dies_after = None
        await world.kill()
        await world.pass_time(timedelta(seconds=5))
        await world.start()
        await world.send(last_word)


async def live(world: Any, cloud: Any, steps: Any) -> None:
    """Turned back with a short battery, charged, and on to the shop."""
    world.clock.rate = 40.0
    world.disturbances = Disturbances.model_validate(SHORT)
    await world.start()
    mission = cloud.mission(plan(steps).made)
    await world.send(mission)
    await world.pass_until(lambda: world.has_died or has_failed(world))
    await survive(world, mission)
    await world.pass_until(lambda: has_failed(world))

    on = steps(at=world.clock.now(), first_step=3)
    on.recharge("home", until_soc=1.0, duration_s=9000)
    on.fly("home", "shop", length_m=19_200, duration_s=1400).deliver("shop", "p1")
    revision = cloud.mission(on.made, revision=2)
    await world.send(revision)
    await world.pass_until(lambda: world.has_died or world.is_over)
    await survive(world, revision)
    await world.pass_until(lambda: world.is_over)


def ends(world: Any) -> list[tuple[int | None, str | None, str | None]]:
    return [
        (event.step_id, event.code, event.station_id)
        for event in world.events
        if event.event != "ALARM"
    ]


HAPPENS = [
    (1, None, "home"),
    (2, "BATTERY_SHORT", "home"),
    (3, None, "home"),
    (4, None, "shop"),
    (5, None, "shop"),
    (None, None, "shop"),
]


@pytest.mark.parametrize("when", ["dies_before", "dies_after"])
@pytest.mark.parametrize("write", sampled(range(1, 21), every=4))
async def test_after_a_crash_at_any_record_of_a_divert_each_step_still_happens_once(
    world: Any, cloud: Any, steps: Any, write: int, when: str
) -> None:
    setattr(world.journal, when, write)

    await live(world, cloud, steps)

    assert world.journal.dies_before is world.journal.dies_after is None, "it never died"
    assert ends(world) == HAPPENS
    assert [event.seq for event in world.events] == list(range(1, len(world.events) + 1))
    failed = next(event for event in world.events if event.event == "STEP_FAILED")
    waited = failed.started_at - world.events[0].ended_at
    assert timedelta() <= waited <= timedelta(seconds=5)
    assert failed.soc == pytest.approx(1.0 - failed.energy_j / 360_000)
    assert world.states[-1].package_ids == ()
    assert world.states[-1].faults == ()


async def test_no_further_record_of_a_divert_is_left_to_crash_at(
    world: Any, cloud: Any, steps: Any
) -> None:
    await live(world, cloud, steps)

    assert ends(world) == HAPPENS
    assert world.journal.writes == 20


@pytest.mark.parametrize("when", ["dies_before", "dies_after"])
@pytest.mark.parametrize("write", range(1, 9))
async def test_after_a_crash_at_any_record_of_a_landing_on_the_spot_the_drone_is_down_once(
    world: Any, cloud: Any, steps: Any, write: int, when: str
) -> None:
    world.clock.rate = 40.0
    world.disturbances = Disturbances.model_validate(BROKEN)
    setattr(world.journal, when, write)
    mission = cloud.mission(plan(steps).made)
    await world.start()
    await world.send(mission)
    await world.pass_until(lambda: world.has_died or has_failed(world))
    await survive(world, mission)
    await world.pass_until(lambda: has_failed(world))
    await world.pass_time(timedelta(hours=1))

    assert world.journal.dies_before is world.journal.dies_after is None, "it never died"
    assert ends(world) == [(1, None, "home"), (2, "MOTOR_FAILURE", None)]
    assert [one.code for one in world.events if one.event == "ALARM"] == ["MOTOR_FAILURE"]
    assert (world.states[-1].activity, world.states[-1].package_ids) == ("DOWN", ("p1",))


async def test_a_drone_that_is_down_takes_no_steps_until_people_have_placed_it(
    world: Any, cloud: Any, steps: Any
) -> None:
    world.clock.rate = 40.0
    world.disturbances = Disturbances.model_validate(BROKEN)
    await world.start()
    await world.send(cloud.mission(plan(steps).made))
    await world.pass_until(lambda: has_failed(world))

    again = steps(at=world.clock.now(), first_step=3)
    again.fly("farm", "shop", length_m=9_600, duration_s=700).deliver("shop", "p1")
    for instruction in (
        cloud.mission(again.made, revision=2),
        cloud.divert(again.made, overrides_failsafe=True),
        cloud.cancel(),
        cloud.mission(plan(steps).made, mission_id="msn_2"),
    ):
        await world.send(instruction)
    codes = [(ack.status, ack.code) for ack in world.acks if ack.status != "RECEIVED"]
    assert codes == [
        ("ACCEPTED", None),
        ("REJECTED", "NOT_AT_START"),
        ("REJECTED", "NOT_AT_START"),
        ("ACCEPTED", None),
        ("REJECTED", "NOT_AT_START"),
    ]
    assert (world.states[-1].activity, world.states[-1].package_ids) == ("DOWN", ("p1",))

    await world.kill()
    world.disturbances = Disturbances()
    world.journal.append([Placed(station_id=StationId("home"), position=Position(-98.0, 30.0))])
    await world.start()
    await world.send(cloud.mission(plan(steps).made, mission_id="msn_3"))

    assert (world.acks[-1].status, world.acks[-1].code) == ("ACCEPTED", None)
    assert (world.states[-1].station_id, world.states[-1].package_ids) == ("home", ())
    assert world.states[-1].faults == ()
