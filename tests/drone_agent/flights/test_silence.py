"""The link is up but the cloud sends nothing: the drone lands and waits."""

from datetime import timedelta
from typing import Any


async def fly(world: Any, cloud: Any, trip: Any) -> None:
    world.clock.rate = 10.0
    await world.start()
    world.link.deliver_time(retained=True)
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: bool(world.states) and world.states[-1].activity == "FLYING")


async def test_a_drone_lands_and_waits_when_the_cloud_falls_silent(
    world: Any, cloud: Any, trip: Any
) -> None:
    await fly(world, cloud, trip)
    world.link.deliver_time(retained=False)
    await world.pass_time(timedelta(hours=2))

    ends = [event for event in world.events if event.event != "ALARM"]
    alarms = [(one.code, one.level) for one in world.events if one.event == "ALARM"]
    assert [event.step_id for event in ends] == [1, 2, 3, 4, 5]
    assert alarms == [("CLOUD_SILENT", "WARNING")]

    back_at = world.clock.now()
    world.link.deliver_time(retained=False)
    await world.pass_until(lambda: any(event.step_id == 6 for event in world.events))

    assert next(one for one in world.events if one.step_id == 6).started_at == back_at


async def test_an_instruction_ends_the_silence_of_the_cloud(
    world: Any, cloud: Any, trip: Any
) -> None:
    await fly(world, cloud, trip)
    world.link.deliver_time(retained=False)
    await world.pass_time(timedelta(hours=2))

    await world.send(cloud.report_request(0))
    await world.pass_until(lambda: any(event.step_id == 6 for event in world.events))

    assert "CLOUD_SILENT" not in world.states[-1].faults


async def test_a_cloud_that_never_repeats_its_clock_is_not_expected_to(
    world: Any, cloud: Any, trip: Any
) -> None:
    await fly(world, cloud, trip)

    await world.pass_until(lambda: world.is_over)

    assert abs(world.events[-1].ended_at - trip[-1].planned_end_at) < timedelta(milliseconds=1)


async def test_a_cloud_that_repeats_its_clock_delays_nothing(
    world: Any, cloud: Any, trip: Any
) -> None:
    await fly(world, cloud, trip)

    while not world.is_over:
        world.link.deliver_time(retained=False)
        await world.pass_time(timedelta(seconds=300))

    assert abs(world.events[-1].ended_at - trip[-1].planned_end_at) < timedelta(milliseconds=1)
    assert all(event.event != "ALARM" for event in world.events)
