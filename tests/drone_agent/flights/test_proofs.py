"""Hand-overs that wait for proofs: the cloud says when a proof is there, or the drone gives up."""

from datetime import timedelta
from typing import Any

import pytest

ARRIVED = 2  # events before the drone waits: PICK_UP and FLY have ended


async def wait_at_the_shop(world: Any, cloud: Any, steps: Any, **proven_by: str) -> None:
    """A drone at the shop with p1 and p2, whose DELIVER is step 3."""
    trip = (
        steps().pick_up("home", p1=0.5, p2=0.5).fly("home", "shop", length_m=6000, duration_s=430)
    )
    trip.deliver("shop", "p1", "p2", recipient_wait_s=300, **proven_by)
    await world.start()
    await world.send(cloud.mission(trip.fly("shop", "home", length_m=6000, duration_s=430).made))
    await world.pass_until(lambda: len(world.events) == ARRIVED + 1)


async def test_a_drone_says_once_that_it_waits_and_for_which_packages(
    world: Any, cloud: Any, steps: Any
) -> None:
    await wait_at_the_shop(world, cloud, steps, p1="PIN")

    await world.pass_time(timedelta(seconds=200))

    _, landed, awaited = world.events
    assert (awaited.event, awaited.package_ids) == ("HAND_OVER_AWAITED", ("p1",))
    assert (awaited.started_at, awaited.station_id) == (landed.ended_at, "shop")
    assert world.states[-1].activity == "DELIVERING"


async def test_a_hand_over_ends_when_all_proofs_are_there(
    world: Any, cloud: Any, steps: Any
) -> None:
    await wait_at_the_shop(world, cloud, steps, p1="PIN", p2="SIGNATURE")
    await world.pass_time(timedelta(seconds=100))

    await world.send(cloud.hand_over("p1"))
    await world.pass_time(timedelta(seconds=50))
    assert len(world.events) == ARRIVED + 1
    await world.send(cloud.hand_over("p2"))
    proven_at = world.clock.now()
    await world.pass_until(lambda: len(world.events) == ARRIVED + 2)

    handed = world.events[-1]
    assert (handed.event, handed.code, handed.package_ids) == ("STEP_ENDED", None, ("p1", "p2"))
    assert handed.ended_at == proven_at + timedelta(seconds=30)


async def test_a_drone_without_proof_gives_up_and_keeps_the_package(
    world: Any, cloud: Any, steps: Any
) -> None:
    await wait_at_the_shop(world, cloud, steps, p1="PIN", p2="PIN")

    await world.pass_until(lambda: len(world.events) == ARRIVED + 2)

    failed = world.events[-1]
    assert (failed.event, failed.code) == ("STEP_FAILED", "RECIPIENT_ABSENT")
    assert (failed.package_ids, world.states[-1].package_ids) == ((), ("p1", "p2"))
    assert failed.ended_at - failed.started_at == timedelta(seconds=300)


async def test_what_has_its_proof_is_handed_over_when_the_wait_ends(
    world: Any, cloud: Any, steps: Any
) -> None:
    await wait_at_the_shop(world, cloud, steps, p1="PIN", p2="PIN")
    await world.send(cloud.hand_over("p2"))

    await world.pass_until(lambda: len(world.events) == ARRIVED + 2)

    failed = world.events[-1]
    assert (failed.event, failed.package_ids) == ("STEP_FAILED", ("p2",))
    assert failed.data["load_before_kg"] - failed.data["load_after_kg"] == 0.5
    assert failed.ended_at - failed.started_at == timedelta(seconds=330)
    assert world.states[-1].package_ids == ("p1",)


async def test_a_restarted_drone_still_waits_and_knows_its_proofs(
    world: Any, cloud: Any, steps: Any
) -> None:
    await wait_at_the_shop(world, cloud, steps, p1="PIN", p2="PIN")
    await world.send(cloud.hand_over("p2"))

    await world.kill()
    await world.start()
    await world.pass_time(timedelta(seconds=10))
    await world.send(cloud.hand_over("p1"))
    await world.pass_until(lambda: world.events[-1].event == "STEP_ENDED")

    handed = [each for each in world.events if each.step_kind == "DELIVER"]
    assert [each.event for each in handed] == [
        "HAND_OVER_AWAITED",
        "HAND_OVER_AWAITED",
        "STEP_ENDED",
    ]
    assert handed[0].started_at == handed[1].started_at
    assert (handed[-1].code, handed[-1].package_ids) == (None, ("p1", "p2"))


@pytest.mark.parametrize(
    "changes",
    [{"step_id": 4}, {"mission_id": "msn_2"}, {"package_ids": ("p9",)}],
    ids=["step", "mission", "package"],
)
async def test_a_proof_for_something_else_is_refused(
    world: Any, cloud: Any, steps: Any, changes: dict[str, Any]
) -> None:
    await wait_at_the_shop(world, cloud, steps, p1="PIN")

    await world.send(cloud.hand_over("p1", **changes))

    assert (world.acks[-1].status, world.acks[-1].code) == ("REJECTED", "NOT_AWAITED")


async def test_a_proof_after_the_wait_is_refused(world: Any, cloud: Any, steps: Any) -> None:
    await wait_at_the_shop(world, cloud, steps, p1="PIN")
    await world.pass_time(timedelta(seconds=301))

    await world.send(cloud.hand_over("p1"))

    assert (world.acks[-1].status, world.acks[-1].code) == ("REJECTED", "NOT_AWAITED")


async def test_new_steps_behind_the_hand_over_do_not_end_the_wait(
    world: Any, cloud: Any, steps: Any
) -> None:
    await wait_at_the_shop(world, cloud, steps, p1="PIN")
    on = steps(at=world.clock.now(), first_step=4).fly(
        "shop", "farm", length_m=6000, duration_s=430
    )

    await world.send(cloud.divert(on.made))
    await world.send(cloud.hand_over("p1"))
    await world.pass_until(lambda: len(world.events) == ARRIVED + 2)

    assert {ack.status for ack in world.acks} == {"RECEIVED", "ACCEPTED"}
    assert world.events[-1].package_ids == ("p1", "p2")
