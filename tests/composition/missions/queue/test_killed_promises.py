"""A promise becomes firm once, also if replicas are killed or are two.

On PostgreSQL, where each statement is a wait, and where two transactions write at the same time.
"""

import asyncio
from datetime import timedelta

import pytest

from skyway.ids import DroneId
from tests.composition.busy_world import BusyWorld
from tests.composition.dispatched_world import until_wait
from tests.composition.missions.queue.booked_chain import book, book_chain, kinds_of

pytestmark = pytest.mark.databases("postgresql")

_DRONE = DroneId("drn_1")
_NEVER = 10_000


async def _wait_for_promises(world: BusyWorld) -> None:
    """Let the moment come at which the promises of two waiting missions have to be firm."""
    await book_chain(world, 1)
    await book(world, "dlv2", "b", "c", qos={"firm_within_s": 600.0})
    await book(world, "dlv3", "c", "a", qos={"firm_within_s": 600.0})
    world.clock.advance(timedelta(minutes=11))


async def _firm(world: BusyWorld) -> list[bool]:
    """Whether each waiting promise is firm, and was reported once."""
    waiting = [each.mission for each in await world.planned() if each.mission.state == "QUEUED"]
    for each in waiting:
        kinds = await kinds_of(world, each.delivery_id)
        assert kinds["PROMISED"] == (each.firm_at is None)
    return [each.firm_at is None for each in waiting]


@pytest.mark.long
async def test_promises_become_firm_together_when_composition_is_killed_anywhere(
    world: BusyWorld,
) -> None:
    await _wait_for_promises(world)

    for wait in range(1, _NEVER):
        try:
            await until_wait(world.calendars.look_at(_DRONE), wait)
            break
        except asyncio.CancelledError:
            assert await _firm(world) in ([False, False], [True, True])
            world.restart()

    assert wait > 10, "no promise was killed while it became firm"
    assert await _firm(world) == [True, True]
    await world.end()


async def test_two_replicas_make_a_promise_firm_once(world: BusyWorld) -> None:
    await _wait_for_promises(world)
    one = world.calendars
    world.restart()

    await asyncio.gather(one.look_at(_DRONE), world.calendars.look_at(_DRONE))

    assert await _firm(world) == [True, True]
    await world.end()
