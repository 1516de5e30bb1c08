"""A drone that is taken out of service loses its QUEUED missions; the one under way it flies."""

from dataclasses import dataclass, field
from typing import Any

import pytest
from skyway_composition.missions.queue.keep_calendars import WithdrawnDrones

from skyway.contracts.drones import OutOfServiceAnswer, OutOfServiceQuery
from tests.composition.busy_world import BusyWorld
from tests.composition.missions.queue.booked_chain import (
    book_chain,
    delivered_by,
    kinds_of,
    reports_of,
    waiting,
)

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


@dataclass
class FakeRegistry:
    """A registry that has taken these drones out of service."""

    withdrawn: set[str] = field(default_factory=set)
    asked: list[tuple[str, ...]] = field(default_factory=list)

    async def call(
        self, _method: str, _path: str, *, body: OutOfServiceQuery, **_: Any
    ) -> OutOfServiceAnswer:
        self.asked.append(tuple(body.drone_ids))
        return OutOfServiceAnswer(
            drone_ids=tuple(each for each in body.drone_ids if each in self.withdrawn),
            due_drone_ids=body.drone_ids,
        )


def withdrawals(world: BusyWorld, registry: FakeRegistry) -> WithdrawnDrones:
    return WithdrawnDrones(world.context, registry)  # type: ignore[arg-type]


async def test_queued_missions_are_given_up_and_the_live_one_is_flown(world: BusyWorld) -> None:
    await book_chain(world, 3)
    registry = FakeRegistry({"drn_1"})

    await withdrawals(world, registry).step()

    assert registry.asked == [("drn_1",)]
    assert await waiting(world) == []
    for delivery_id in ("dlv2", "dlv3"):
        (refused,) = [
            each for each in await reports_of(world, delivery_id) if each.kind == "REFUSED"
        ]
        assert (refused.code, refused.detail) == ("DRONE_NOT_FREE", "its drone is out of service")
    assert (await kinds_of(world, "dlv1"))["REFUSED"] == 0
    await world.check()
    await world.end()
    assert delivered_by(world) == ["dlv1"]


async def test_drones_in_service_keep_their_missions(world: BusyWorld) -> None:
    await book_chain(world, 2)

    await withdrawals(world, FakeRegistry({"drn_2"})).step()

    assert await waiting(world) == ["dlv2"]
    await world.end()


async def test_nobody_is_asked_while_nothing_is_queued(world: BusyWorld) -> None:
    await book_chain(world, 1)
    registry = FakeRegistry({"drn_1"})

    await withdrawals(world, registry).step()

    assert registry.asked == []
    await world.end()
