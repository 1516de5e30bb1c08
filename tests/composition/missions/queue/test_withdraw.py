"""A delivery whose request changes loses its QUEUED missions; a mission that was sent stays."""

import pytest
from skyway_composition.missions.interventions.withdraw import withdraw_missions

from skyway.contracts.mission import WithdrawMissions
from skyway.ids import DeliveryId
from skyway.runtime.errors import Conflict
from tests.composition.busy_world import BusyWorld
from tests.composition.missions.queue.booked_chain import (
    CHAIN,
    book,
    book_chain,
    delivered_by,
    reports_of,
    waiting,
)


async def withdraw(world: BusyWorld, delivery_id: str, *, attempt: int = 1) -> None:
    asked = WithdrawMissions(attempt=attempt)
    await withdraw_missions(world.context, DeliveryId(delivery_id), asked)


@pytest.mark.databases("postgresql")
async def test_a_queued_mission_is_given_up_and_its_attempt_is_not_booked_again(
    world: BusyWorld,
) -> None:
    await book_chain(world, 3)

    await withdraw(world, "dlv3")
    await withdraw(world, "dlv3")

    assert await waiting(world) == ["dlv2"]
    (refused,) = [each for each in await reports_of(world, "dlv3") if each.kind == "REFUSED"]
    assert refused.code == "CHANGED"
    await world.check()
    await world.end()
    assert delivered_by(world) == ["dlv1", "dlv2"]


async def test_an_attempt_that_was_withdrawn_before_it_was_booked_is_not_booked(
    world: BusyWorld,
) -> None:
    await book_chain(world, 1)

    await withdraw(world, "dlv2")

    assert await book(world, "dlv2", *CHAIN["dlv2"]) == "WITHDRAWN"
    assert await waiting(world) == []
    await world.end()


@pytest.mark.parametrize("after_min", [0, 600], ids=["sent", "flown"])
async def test_a_mission_that_was_sent_stays(world: BusyWorld, after_min: int) -> None:
    await book_chain(world, 2)
    if after_min:
        await world.end()

    with pytest.raises(Conflict) as refused:
        await withdraw(world, "dlv1")

    assert refused.value.code == "TOO_LATE"
    await world.check()
    await world.end()
    assert delivered_by(world) == ["dlv1", "dlv2"]


async def test_what_was_withdrawn_stays_so_after_a_late_call(world: BusyWorld) -> None:
    await withdraw(world, "dlv1", attempt=2)
    await withdraw(world, "dlv1", attempt=1)

    assert await book(world, "dlv1", *CHAIN["dlv1"]) == "WITHDRAWN"
    await world.end()
