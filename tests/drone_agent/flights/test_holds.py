"""A drone that is held begins no step until it is resumed, replanned or called off."""

from datetime import timedelta
from typing import Any

import pytest

A_DAY = timedelta(days=1)


async def fly(world: Any, cloud: Any, trip: Any) -> None:
    """In the air towards the first landing, with two packages on board."""
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: any(state.activity == "FLYING" for state in world.states))


async def charge(world: Any, cloud: Any, trip: Any) -> None:
    """On the pad, with one package on board."""
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: world.states[-1].activity == "RECHARGING")


async def test_a_drone_held_in_the_air_flies_to_its_next_landing_and_stands(
    world: Any, cloud: Any, trip: Any
) -> None:
    await fly(world, cloud, trip)

    await world.send(cloud.hold())
    assert world.states[-1].is_held
    await world.pass_time(A_DAY)

    assert [event.step_id for event in world.events] == [1, 2, 3]
    assert (world.states[-1].activity, world.states[-1].station_id) == ("WAITING", "shop")


async def test_a_recharge_goes_on_while_the_drone_is_held(
    world: Any, cloud: Any, trip: Any
) -> None:
    await charge(world, cloud, trip)

    await world.send(cloud.hold())
    await world.pass_time(A_DAY)

    assert (world.events[-1].step_kind, world.events[-1].code) == ("RECHARGE", None)
    assert len(world.events) == 5


async def test_a_drone_goes_on_from_where_it_was_held(world: Any, cloud: Any, trip: Any) -> None:
    await charge(world, cloud, trip)
    await world.send(cloud.hold())
    await world.pass_time(A_DAY)
    resumed_at = world.clock.now()

    await world.send(cloud.resume())
    assert not world.states[-1].is_held
    await world.pass_until(lambda: world.is_over)

    assert world.events[5].started_at == resumed_at
    assert [event.step_id for event in world.events] == [*range(1, 9), None]


async def test_a_mission_that_is_held_does_not_end(world: Any, cloud: Any, steps: Any) -> None:
    hop = steps().fly("home", "shop", length_m=6000, duration_s=430)
    await fly(world, cloud, hop.made)

    await world.send(cloud.hold())
    await world.pass_time(A_DAY)
    assert not world.is_over
    await world.send(cloud.resume())
    await world.pass_until(lambda: world.is_over)

    assert [event.step_id for event in world.events] == [1, None]


async def test_a_drone_that_was_held_at_the_end_flies_on_with_new_steps(
    world: Any, cloud: Any, steps: Any
) -> None:
    hop = steps().fly("home", "shop", length_m=6000, duration_s=430)
    await fly(world, cloud, hop.made)
    await world.send(cloud.hold())
    await world.pass_time(A_DAY)

    again = steps(at=world.clock.now(), first_step=2)
    again.fly("shop", "home", length_m=6000, duration_s=330)
    await world.send(cloud.divert(again.made))
    await world.pass_until(lambda: world.is_over)

    assert [event.step_id for event in world.events] == [1, 2, None]


@pytest.mark.parametrize("kind", ["mission", "divert"])
async def test_new_steps_end_a_hold(world: Any, cloud: Any, trip: Any, kind: str) -> None:
    await charge(world, cloud, trip)
    await world.send(cloud.hold())

    await world.send(getattr(cloud, kind)(trip[5:], revision=2))
    assert not world.states[-1].is_held
    await world.pass_until(lambda: world.is_over)

    assert [event.step_id for event in world.events] == [*range(1, 9), None]


async def test_a_divert_and_a_hold_right_after_it_leave_the_drone_standing(
    world: Any, cloud: Any, trip: Any, steps: Any
) -> None:
    await charge(world, cloud, trip)
    hop = steps(at=world.clock.now(), first_step=5)
    hop.fly("shop", "farm", length_m=7000, duration_s=430)

    for instruction in (cloud.divert(hop.made), cloud.hold()):
        world.link.deliver(instruction.model_dump_json().encode())
    await world.pass_time(A_DAY)

    assert [ack.status for ack in world.acks[-2:]] == ["RECEIVED", "ACCEPTED"]
    assert (world.events[-1].step_id, world.events[-1].code) == (5, "CUT")
    assert world.states[-1].is_held
    assert world.states[-1].station_id == "shop"


async def test_a_second_divert_counts_what_the_cut_recharge_gave(
    world: Any, cloud: Any, steps: Any
) -> None:
    trip = steps().fly("home", "shop", length_m=50_000, duration_s=2530)
    trip.recharge("shop", until_soc=0.9, duration_s=7200)
    await charge(world, cloud, trip.made)
    await world.pass_time(timedelta(seconds=1800))

    for revision, length_m in ((2, 15_000), (3, 20_000)):
        hop = steps(at=world.clock.now(), first_step=2)
        hop.fly("shop", "farm", length_m=length_m, duration_s=length_m / 20 + 30)
        divert = cloud.divert(hop.made, revision=revision)
        world.link.deliver(divert.model_dump_json().encode())
    await world.pass_until(lambda: world.is_over)

    assert [(event.mission_revision, event.step_id) for event in world.events[:3]] == [
        (1, 1),
        (1, 2),
        (3, 2),
    ]
    assert (world.events[1].code, world.events[2].code) == ("CUT", None)


@pytest.mark.parametrize("kind", ["hold", "resume"])
async def test_another_mission_is_not_held(world: Any, cloud: Any, trip: Any, kind: str) -> None:
    await world.start()
    await world.send(cloud.mission(trip))

    await world.send(getattr(cloud, kind)(mission_id="msn_0"))

    assert world.acks[-1].code == "STALE_REVISION"
    assert not world.states[-1].is_held
