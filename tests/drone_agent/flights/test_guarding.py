"""How often a drone looks at itself: seldom on the ground, each second in the air."""

from datetime import datetime, timedelta
from itertools import pairwise
from typing import Any

import pytest
from skyway_drone_agent.simulated.vehicle import SimulatedVehicle
from skyway_drone_agent.vehicle import Reading, Standing

MINUTE = timedelta(minutes=1)


class LookedAt(SimulatedVehicle):
    """Remembers when it was looked at, and what it did then."""

    looks: list[tuple[datetime, str]]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        LookedAt.looks = []

    def read(self, doing: Any, at: datetime) -> Reading:
        what = "STAND" if isinstance(doing, Standing) else doing.step.kind
        self.looks.append((at, what))
        return super().read(doing, at)


def looks_at(what: str) -> list[datetime]:
    return [at for at, done in LookedAt.looks if done == what]


@pytest.fixture
async def looked_at(world: Any) -> Any:
    """A drone at clock rate 1 that is looked at."""
    world.clock.rate = 1.0
    world.vehicle_type = LookedAt
    await world.start()
    return world


async def load(world: Any, cloud: Any, trip: Any) -> None:
    await world.send(cloud.mission(trip))
    await world.pass_until(lambda: world.states[-1].activity == "LOADING")


async def test_a_drone_that_loads_is_looked_at_every_five_seconds(
    looked_at: Any, cloud: Any, trip: Any
) -> None:
    await load(looked_at, cloud, trip)
    before = len(LookedAt.looks)

    await looked_at.pass_time(0.5 * MINUTE)

    assert 6 <= len(LookedAt.looks) - before <= 8


async def test_a_drone_is_checked_at_take_off_and_then_each_second(
    looked_at: Any, cloud: Any, trip: Any
) -> None:
    await load(looked_at, cloud, trip)
    await looked_at.pass_until(lambda: looked_at.states[-1].activity == "FLYING")
    taken_off_at = looked_at.events[-1].ended_at

    await looked_at.pass_time(MINUTE)

    looks = looks_at("FLY")
    assert looks[0] - taken_off_at < timedelta(seconds=1)
    gaps = [after - before for before, after in pairwise(looks)]
    assert max(gaps) <= timedelta(seconds=1)
    assert 55 <= len(looks) <= 65


async def test_a_drone_that_stands_is_checked_once_for_guard_and_state(looked_at: Any) -> None:
    await looked_at.pass_time(MINUTE)
    before = len(LookedAt.looks)

    await looked_at.pass_time(5 * MINUTE)

    assert len(LookedAt.looks) - before == 10


async def test_guard_and_state_look_together_after_a_lost_link_too(looked_at: Any) -> None:
    await looked_at.pass_time(MINUTE)
    looked_at.link.cut()
    await looked_at.pass_time(0.7 * MINUTE)
    looked_at.link.connect()
    await looked_at.pass_time(MINUTE)
    before = len(LookedAt.looks)

    await looked_at.pass_time(5 * MINUTE)

    assert len(LookedAt.looks) - before == 10
