"""Loading that a loader confirms: the drone waits until the cloud reports the load."""

from datetime import timedelta
from typing import Any

import pytest


def measured(**masses_kg: float) -> list[dict[str, Any]]:
    return [{"package_id": name, "mass_kg": mass_kg} for name, mass_kg in masses_kg.items()]


def to_shop(world: Any, steps: Any, *packages: str) -> list[Any]:
    """The steps after the loading, from now on."""
    after = steps(at=world.clock.now(), first_step=2)
    after.fly("home", "shop", length_m=6000, duration_s=430)
    made: list[Any] = after.deliver("shop", *packages).made
    return made


async def stand_at_the_pickup(world: Any, cloud: Any, steps: Any) -> None:
    """Awaiting p1 and p2 of 0.5 kg each."""
    trip = steps().pick_up("home", awaits_confirmation=True, p1=0.5, p2=0.5)
    trip.fly("home", "shop", length_m=6000, duration_s=430).deliver("shop", "p1", "p2")
    await world.start()
    await world.send(cloud.mission(trip.made))
    await world.pass_until(lambda: world.states[-1].activity == "LOADING")


async def test_a_drone_waits_until_the_cloud_confirms_its_load(
    world: Any, cloud: Any, steps: Any
) -> None:
    await stand_at_the_pickup(world, cloud, steps)

    await world.pass_time(timedelta(hours=1))

    assert world.events == []
    assert (world.states[-1].activity, world.states[-1].load_kg) == ("LOADING", 0.0)


async def test_the_measured_load_counts_after_the_confirmation(
    world: Any, cloud: Any, steps: Any
) -> None:
    await stand_at_the_pickup(world, cloud, steps)
    await world.pass_time(timedelta(hours=1))
    confirmed_at = world.clock.now()

    loaded = measured(p1=0.6, p2=0.4)
    await world.send(cloud.mission(to_shop(world, steps, "p1", "p2"), revision=2, loaded=loaded))
    await world.pass_until(lambda: len(world.events) >= 2)

    picked_up, flown = world.events[:2]
    assert picked_up.ended_at == confirmed_at
    assert picked_up.data["mass_kg"] == {"p1": 0.6, "p2": 0.4}
    assert picked_up.data["load_after_kg"] == 1.0
    assert (flown.started_at, flown.mission_revision) == (confirmed_at, 2)


async def test_a_confirmation_does_not_make_the_loading_shorter_than_planned(
    world: Any, cloud: Any, steps: Any
) -> None:
    await stand_at_the_pickup(world, cloud, steps)
    began_at = world.clock.now()

    await world.send(
        cloud.mission(to_shop(world, steps, "p1"), revision=2, loaded=measured(p1=0.5))
    )
    await world.pass_until(lambda: len(world.events) == 1)

    assert world.events[0].ended_at == began_at + timedelta(seconds=60)
    assert world.events[0].package_ids == ("p1",)


@pytest.mark.parametrize(
    ("masses_kg", "code"),
    [({"p1": 1.2, "p2": 1.2}, "OVERWEIGHT"), ({"p1": 0.5}, "MALFORMED")],
)
async def test_a_load_that_does_not_fit_the_plan_is_refused_and_awaited_on(
    world: Any, cloud: Any, steps: Any, masses_kg: dict[str, float], code: str
) -> None:
    await stand_at_the_pickup(world, cloud, steps)

    after = to_shop(world, steps, "p1", "p2")
    await world.send(cloud.mission(after, revision=2, loaded=measured(**masses_kg)))
    await world.pass_time(timedelta(hours=1))

    assert world.acks[-1].code == code
    assert world.events == []


async def test_a_load_heavier_than_the_energy_carries_is_refused(
    world: Any, cloud: Any, steps: Any
) -> None:
    await stand_at_the_pickup(world, cloud, steps)
    far = steps(at=world.clock.now(), first_step=2)
    far.fly("home", "shop", length_m=25_000, duration_s=2000).deliver("shop", "p1")

    await world.send(cloud.mission(far.made, revision=2, loaded=measured(p1=2.0)))
    assert world.acks[-1].code == "INSUFFICIENT_ENERGY"
    await world.send(cloud.mission(far.made, revision=2, loaded=measured(p1=0.5)))
    assert world.acks[-1].status == "ACCEPTED"


async def test_an_unexpected_load_is_refused(world: Any, cloud: Any, trip: Any) -> None:
    await world.start()
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: world.states[-1].activity == "LOADING")

    await world.send(cloud.mission(trip[1:], revision=2, loaded=measured(p1=0.5, p2=0.5)))

    assert (world.acks[-1].status, world.acks[-1].code) == ("REJECTED", "MALFORMED")


async def test_a_new_plan_without_a_load_leaves_the_drone_waiting_for_it(
    world: Any, cloud: Any, steps: Any
) -> None:
    await stand_at_the_pickup(world, cloud, steps)

    await world.send(cloud.mission(to_shop(world, steps, "p2"), revision=2))
    await world.pass_time(timedelta(hours=1))

    assert world.acks[-1].status == "ACCEPTED"
    assert world.states[-1].activity == "LOADING"
    assert world.events == []
