"""Nobody is there to take a package: the drone keeps it, and waits for new steps."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_drone_agent.simulated.disturbances import Disturbances

from skyway.ids import StationId


@pytest.fixture
async def stood_up(world: Any, cloud: Any, steps: Any) -> Any:
    """A drone that waited 5 minutes at the shop and found no recipient."""
    world.disturbances = Disturbances(absent_station_ids=frozenset({StationId("shop")}))
    trip = (
        steps()
        .pick_up("home", p1=0.5, p2=0.5)
        .fly("home", "shop", length_m=6000, duration_s=430)
        .deliver("shop", "p1", recipient_wait_s=300)
        .fly("shop", "farm", length_m=6000, duration_s=430)
        .deliver("farm", "p2", recipient_wait_s=300)
    )
    await world.start()
    await world.send(cloud.mission(trip.made))
    await world.pass_until(lambda: len(world.events) == 3)
    return world


async def test_a_drone_without_recipient_waits_and_reports_the_absence(stood_up: Any) -> None:
    landed, failed = stood_up.events[1:]

    assert (failed.event, failed.code) == ("STEP_FAILED", "RECIPIENT_ABSENT")
    assert (failed.step_id, failed.step_kind, failed.station_id) == (3, "DELIVER", "shop")
    assert failed.started_at == landed.ended_at
    assert failed.ended_at - landed.ended_at == timedelta(seconds=300)
    assert failed.package_ids == ()


async def test_the_drone_stands_with_its_packages(stood_up: Any) -> None:
    await stood_up.pass_time(timedelta(days=1))

    state = stood_up.states[-1]
    assert (state.activity, state.station_id, state.step_id) == ("WAITING", "shop", 3)
    assert state.package_ids == ("p1", "p2")
    assert len(stood_up.events) == 3


@pytest.mark.parametrize("kind", ["mission", "divert"])
async def test_new_steps_take_the_package_elsewhere(
    stood_up: Any, cloud: Any, steps: Any, kind: str
) -> None:
    on = steps(at=stood_up.clock.now(), first_step=4)
    on.fly("shop", "farm", length_m=6000, duration_s=430).deliver("farm", "p2")
    on.fly("farm", "home", length_m=6000, duration_s=430).bring_back("home", "p1")

    await stood_up.send(getattr(cloud, kind)(on.made, revision=2))
    await stood_up.pass_until(lambda: stood_up.is_over)

    assert [event.step_id for event in stood_up.events] == [1, 2, 3, 4, 5, 6, 7, None]
    assert stood_up.states[-1].package_ids == ()


async def test_the_step_that_failed_is_not_tried_again(
    stood_up: Any, cloud: Any, steps: Any
) -> None:
    again = steps(at=stood_up.clock.now(), first_step=3).deliver("shop", "p1", "p2")

    await stood_up.send(cloud.divert(again.made))

    assert stood_up.acks[-1].code == "STEP_RELEASED"
    assert stood_up.acks[-1].data == {"released_through": 3, "step_id": 3}


async def test_a_drone_without_a_recipient_can_be_called_off(stood_up: Any, cloud: Any) -> None:
    await stood_up.send(cloud.cancel())

    assert stood_up.acks[-1].status == "ACCEPTED"
    assert (stood_up.states[-1].mission_id, stood_up.states[-1].package_ids) == (None, ())
