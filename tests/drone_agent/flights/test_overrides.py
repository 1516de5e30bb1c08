"""People override a failsafe: the drone flies on; only the last battery level stays."""

from typing import Any

import pytest
from skyway_drone_agent.simulated.disturbances import Disturbances

from tests.long_cases import sampled

DRIFT = {"drift": {"share": 1.0, "after_s": 60, "most_m": 900}}


async def turned(world: Any, cloud: Any, steps: Any, **disturbances: Any) -> None:
    """On an escape flight, with p1 on board."""
    trip = steps().pick_up("home", p1=1.0)
    trip.fly("home", "farm", length_m=28_900, duration_s=2000).deliver("farm", "p1")
    world.clock.rate = 40.0
    world.disturbances = Disturbances.model_validate(disturbances)
    await world.start()
    await world.send(cloud.mission(trip.made))
    await world.pass_until(lambda: bool(world.states) and world.states[-1].failsafe is not None)


def beyond(world: Any, steps: Any) -> Any:
    """Steps behind the flight to the farm."""
    on = steps(at=world.clock.now(), first_step=3).recharge("farm", until_soc=1.0, duration_s=9000)
    return on.deliver("farm", "p1").made


@pytest.mark.parametrize("kind", ["divert", "return_home"])
async def test_new_steps_are_refused_while_a_failsafe_acts(
    world: Any, cloud: Any, steps: Any, kind: str
) -> None:
    await turned(world, cloud, steps, **DRIFT)

    await world.send(getattr(cloud, kind)(beyond(world, steps)))
    await world.send(cloud.mission(beyond(world, steps), revision=2))

    last = [(ack.status, ack.code, ack.data) for ack in world.acks if ack.status != "RECEIVED"]
    assert last[1:] == [("REJECTED", "FAILSAFE_ACTIVE", {"fault": "GEOFENCE"})] * 2
    assert world.states[-1].failsafe.station_id == "farm"


@pytest.mark.parametrize("kind", ["divert", "return_home"])
async def test_after_an_override_the_drone_flies_on_and_ignores_the_fault(
    world: Any, cloud: Any, steps: Any, kind: str
) -> None:
    await turned(world, cloud, steps, **DRIFT)

    override = getattr(cloud, kind)(beyond(world, steps), overrides_failsafe=True)
    await world.send(override)
    assert (world.acks[-1].status, world.states[-1].failsafe) == ("ACCEPTED", None)
    await world.pass_until(lambda: world.is_over)

    ends = [(one.event, one.step_id, one.station_id) for one in world.events if one.step_id]
    assert ends == [
        ("STEP_ENDED", 1, "home"),
        ("STEP_ENDED", 2, "farm"),
        ("STEP_ENDED", 3, "farm"),
        ("STEP_ENDED", 4, "farm"),
    ]
    flown = next(one for one in world.events if one.step_id == 2)
    assert flown.soc == pytest.approx(1.0 - flown.energy_j / 360_000)
    assert flown.started_at == world.events[0].ended_at
    assert world.states[-1].package_ids == ()


async def test_a_short_battery_is_overridden_despite_the_energy_check(
    world: Any, cloud: Any, steps: Any
) -> None:
    await turned(world, cloud, steps, flight_energy_factor=1.29)

    await world.send(cloud.divert(beyond(world, steps), overrides_failsafe=True))
    await world.pass_until(lambda: any(one.step_id == 2 for one in world.events))

    assert world.acks[-1].status == "ACCEPTED"
    landed = next(one for one in world.events if one.step_id == 2)
    assert (landed.event, landed.station_id) == ("STEP_ENDED", "farm")


async def test_an_override_that_is_refused_for_another_reason_changes_nothing(
    world: Any, cloud: Any, steps: Any
) -> None:
    await turned(world, cloud, steps, **DRIFT)

    elsewhere = steps(at=world.clock.now(), first_step=3).deliver("shop", "p1")
    await world.send(cloud.divert(elsewhere.made, overrides_failsafe=True))

    assert (world.acks[-1].status, world.acks[-1].code) == ("REJECTED", "NOT_AT_START")
    assert world.states[-1].failsafe.fault == "GEOFENCE"


async def test_the_last_battery_level_is_never_overridden(
    world: Any, cloud: Any, steps: Any
) -> None:
    trip = steps().pick_up("home", p1=1.0)
    trip.fly("home", "farm", length_m=28_900, duration_s=2000).deliver("farm", "p1")
    world.clock.rate = 600.0
    world.disturbances = Disturbances(flight_energy_factor=12.0)
    await world.start()
    await world.send(cloud.mission(trip.made))
    await world.pass_until(
        lambda: bool(world.states) and "BATTERY_EMPTY" in world.states[-1].faults
    )

    await world.send(cloud.divert(beyond(world, steps), overrides_failsafe=True))

    assert (world.acks[-1].code, world.acks[-1].data) == (
        "FAILSAFE_ACTIVE",
        {"fault": "BATTERY_EMPTY"},
    )
    await world.pass_until(lambda: world.states[-1].activity == "DOWN")


@pytest.mark.parametrize("when", ["dies_before", "dies_after"])
@pytest.mark.parametrize("later", sampled([1, 2, 3], every=3))
async def test_after_a_crash_around_an_override_it_still_holds(
    world: Any, cloud: Any, steps: Any, later: int, when: str
) -> None:
    await turned(world, cloud, steps, **DRIFT)
    setattr(world.journal, when, world.journal.writes + later)
    override = cloud.divert(beyond(world, steps), overrides_failsafe=True)
    await world.send(override)
    await world.pass_until(lambda: world.has_died)

    world.journal.dies_before = world.journal.dies_after = None
    await world.kill()
    await world.start()
    await world.send(override)
    await world.pass_until(lambda: world.is_over)

    assert [one.step_id for one in world.events if one.step_id] == [1, 2, 3, 4]
    assert {one.event for one in world.events if one.step_id} == {"STEP_ENDED"}
