"""A provisional promise of a QUEUED mission becomes firm in time, and once."""

from datetime import timedelta
from typing import Any

import pytest

from tests.composition.busy_network import NETWORK_ID
from tests.composition.busy_world import BusyWorld
from tests.composition.dispatched_world import PROVIDER, dispatch_fairly, dispatcher_of
from tests.composition.missions.queue.booked_chain import (
    book,
    book_chain,
    etas,
    kinds_of,
    pass_minutes,
    reports_of,
)

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


def _firm_within(seconds: float) -> dict[str, Any]:
    return {"qos": {"firm_within_s": seconds}}


async def _promised(world: BusyWorld, delivery_id: str) -> Any:
    """When the package of a waiting delivery is promised, and until when that may change."""
    (record,) = [each for each in await world.planned() if each.mission.delivery_id == delivery_id]
    (eta,) = record.promised
    return eta.eta_at, record.mission.firm_at


async def test_a_promise_becomes_firm_with_the_plan_of_that_moment(world: BusyWorld) -> None:
    await book(world, "dlv1", "a", "b")
    for number in range(2, 5):
        await book(world, f"dlv{number}", "a", "b", **_firm_within(600.0))
    await book(world, "dlv5", "b", "c", drone=2)
    first, firm_at = await _promised(world, "dlv4")
    assert firm_at == world.clock.now() + timedelta(seconds=600)

    assert (await dispatch_fairly(world, tolerance_s=0.0))[0] == "adopted"
    moved = (await etas(world))["dlv4"]
    assert await _promised(world, "dlv4") == (first, firm_at)
    await pass_minutes(world, 11)

    assert moved != first
    assert await _promised(world, "dlv4") == (moved, None)
    assert (await kinds_of(world, "dlv4"))["PROMISED"] == 1
    await world.end()


async def test_a_mission_that_is_sent_is_promised_before(world: BusyWorld) -> None:
    await book_chain(world, 1)
    await book(world, "dlv2", "b", "c", **_firm_within(3_600.0))

    await world.end()

    kinds = [each.kind for each in await reports_of(world, "dlv2")]
    assert kinds.index("PROMISED") < kinds.index("ACCEPTED")
    assert kinds.count("PROMISED") == 1


async def test_a_mission_that_is_sent_with_its_booking_has_a_firm_promise(
    world: BusyWorld,
) -> None:
    await book(world, "dlv1", "a", "b", **_firm_within(3_600.0))

    (record,) = await world.live()

    assert record.mission.firm_at is None
    assert (await kinds_of(world, "dlv1"))["PROMISED"] == 0


async def test_a_delivery_that_is_cancelled_before_is_never_promised(world: BusyWorld) -> None:
    await book_chain(world, 1)
    await book(world, "dlv2", "b", "c", **_firm_within(600.0))

    await world.cancel("dlv2", None)
    await pass_minutes(world, 15)

    assert (await kinds_of(world, "dlv2"))["PROMISED"] == 0


async def test_nothing_moves_between_the_moment_of_a_promise_and_its_report(
    world: BusyWorld,
) -> None:
    await book(world, "dlv1", "a", "b")
    for number in range(2, 5):
        await book(world, f"dlv{number}", "a", "b", **_firm_within(600.0))
    await book(world, "dlv5", "b", "c", drone=2)
    dispatcher = dispatcher_of(world, tolerance_s=0.0)

    world.clock.advance(timedelta(minutes=11))
    late = await dispatcher.look_at(NETWORK_ID, PROVIDER)
    await world.keep_calendars()

    assert late == "unsearched"
    assert (await kinds_of(world, "dlv4"))["PROMISED"] == 1
    assert await dispatcher.look_at(NETWORK_ID, PROVIDER) != "unsearched"
