"""A real drone that waits for a proof: it releases nothing before the proof is there."""

from typing import Any

import pytest


async def wait_at_the_shop(world: Any, cloud: Any, steps: Any, *, wait_s: float) -> None:
    trip = (
        steps().pick_up("home", p1=0.5, p2=0.5).fly("home", "shop", length_m=6000, duration_s=400)
    )
    trip.deliver("shop", "p1", "p2", recipient_wait_s=wait_s, p1="PIN", p2="PIN")
    await world.start()
    await world.send(cloud.mission(trip.made))


@pytest.fixture
async def landed(world: Any, vehicle: Any, cloud: Any, steps: Any, until: Any) -> Any:
    """The world whose drone waits at the shop for two proofs."""
    await wait_at_the_shop(world, cloud, steps, wait_s=600)
    await until(lambda: world.events and world.events[-1].event == "HAND_OVER_AWAITED")
    return world


async def test_the_packages_are_released_after_the_last_proof(
    landed: Any, cloud: Any, peer: Any, until: Any
) -> None:
    await landed.send(cloud.hand_over("p1"))
    assert peer.released == 0

    await landed.send(cloud.hand_over("p2"))
    await until(lambda: landed.is_over)

    assert (peer.released, landed.events[-2].package_ids) == (1, ("p1", "p2"))


async def test_an_agent_killed_while_it_waits_goes_on_waiting(
    landed: Any, vehicle: Any, cloud: Any, peer: Any, until: Any
) -> None:
    await landed.kill()
    await vehicle()
    await landed.start()

    await landed.send(cloud.hand_over("p1", "p2"))
    await until(lambda: landed.is_over)

    assert (peer.released, landed.events[-2].code) == (1, None)


async def test_without_all_proofs_nothing_is_released(
    world: Any, vehicle: Any, cloud: Any, steps: Any, peer: Any, until: Any
) -> None:
    await wait_at_the_shop(world, cloud, steps, wait_s=20)
    await until(lambda: world.events and world.events[-1].event == "HAND_OVER_AWAITED")
    await world.send(cloud.hand_over("p1"))

    await until(lambda: world.events[-1].event == "STEP_FAILED")

    assert (world.events[-1].code, world.events[-1].package_ids) == ("RECIPIENT_ABSENT", ())
    assert peer.released == 0
