"""The dispatcher plans deliveries with a window at any time within their window."""

from datetime import timedelta
from typing import Any

import pytest

from tests.composition.busy_world import BusyWorld
from tests.composition.dispatched_world import dispatch_fairly
from tests.composition.missions.queue.booked_chain import book, etas

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def _after_a_search(world: BusyWorld, **window: Any) -> tuple[str, timedelta]:
    """What a search does with a long delivery before a short one, and how much later it comes."""
    assert await book(world, "dlv1", "a", "b") == "BOOKED"
    assert await book(world, "dlv2", "b", "c", "a", **window) == "BOOKED"
    assert await book(world, "dlv3", "b", "c") == "BOOKED"
    before = await etas(world)
    outcome, *_ = await dispatch_fairly(world, tolerance_s=0.0)
    after = await etas(world)
    return outcome, after["dlv2"] - before["dlv2"]


async def test_a_delivery_comes_later_within_its_window_if_another_gains_more(
    world: BusyWorld,
) -> None:
    now = world.clock.now()
    window = {"not_before_at": now, "latest_at": now + timedelta(hours=4)}

    outcome, later = await _after_a_search(world, window=window)

    assert outcome == "adopted"
    assert timedelta() < later < timedelta(hours=4)


async def test_without_a_window_it_keeps_its_promise(world: BusyWorld) -> None:
    outcome, later = await _after_a_search(world)

    assert (outcome, later) == ("kept", timedelta())
