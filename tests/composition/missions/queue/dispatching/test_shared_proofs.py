"""A host and a guest who both ask for proofs: each is notified of its own packages only."""

from collections.abc import Mapping
from datetime import timedelta

import pytest
from skyway_composition.missions.interventions.give_proof import give_proof
from skyway_composition.missions.mission.record import MissionRecord

from skyway.contracts.mission_reports import MissionReport
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, PackageId
from skyway.runtime.errors import Conflict
from tests.composition.busy_world import BusyWorld
from tests.composition.dispatched_world import dispatch_fairly
from tests.composition.missions.queue.booked_chain import book, reports_of, request
from tests.composition.missions.queue.dispatching.shared_requests import asks

pytestmark = pytest.mark.databases("sqlite")


def with_pin(request: DeliveryRequest) -> DeliveryRequest:
    asked = request.model_dump(mode="json")
    for each in asked["packages"]:
        each["dropoff_verification"] = {"method": "PIN", "wait_s": 900}
    return DeliveryRequest.model_validate(asked)


async def book_both(world: BusyWorld) -> MissionRecord:
    """A shared trip to b, where both customers have a package p1 with a PIN."""
    for delivery_id in ("dlv1", "dlv2"):
        request = with_pin(asks("b")).begun_after_wait(world.clock.now())
        await world.book(delivery_id, request, loading="AUTOMATIC")
        await world.keep_calendars()
    (record,) = await world.planned()
    assert len(record.shares) == 2
    return record


async def awaited(world: BusyWorld) -> Mapping[str, MissionReport]:
    """The wait at b, as it is reported to each delivery."""
    found: dict[str, MissionReport] = {}
    while len(found) < 2:
        await world.pass_time(timedelta(minutes=1))
        for delivery_id in ("dlv1", "dlv2"):
            for each in await reports_of(world, delivery_id):
                if each.until_at is not None:
                    found[delivery_id] = each
    return found


async def test_each_delivery_gets_its_own_wait_and_gives_its_own_proof(
    world: BusyWorld,
) -> None:
    world.recipients = "ABSENT"
    await book_both(world)

    waits = await awaited(world)
    await give_proof(world.context, DeliveryId("dlv2"), PackageId("p1"))
    await world.end()

    assert {each.package_ids for each in waits.values()} == {("p1",)}
    assert await world.handed_over() == [("dlv2", "p1")]
    kinds = [each.kind for each in await reports_of(world, "dlv1")]
    assert "RETURNED" in kinds
    assert "DELIVERED" not in kinds


async def test_a_package_that_is_not_of_the_delivery_has_no_proof(world: BusyWorld) -> None:
    world.recipients = "ABSENT"
    record = await book_both(world)
    await awaited(world)

    flying = next(iter(record.shares[1].packages))
    with pytest.raises(Conflict):
        await give_proof(world.context, DeliveryId("dlv1"), flying)


@pytest.mark.long
async def test_a_request_with_a_proof_leaves_the_windows_of_others_as_they_are(
    world: BusyWorld,
) -> None:
    """The fleet's problem has one time for all hand-overs: 60 s, where a window has 30 s."""
    for number in range(1, 4):
        assert await book(world, f"dlv{number}", "a", "b") == "BOOKED"
    proven = with_pin(request("dlv4", "a", "b"))
    narrow = request("dlv5", "b", "c")
    first_at = world.clock.now() + timedelta(hours=20)
    window = {"not_before_at": first_at, "latest_at": first_at + timedelta(seconds=30)}
    package = narrow.packages[0].model_copy(update=window)
    narrow = narrow.model_copy(update={"packages": (package,)})
    for each in (proven, narrow):
        drones = world.drones[:1]
        delivery_id = each.packages[0].package_id.split("_")[0]
        booked = await world.book(delivery_id, each, loading="AUTOMATIC", drones=drones)
        assert booked == "BOOKED"
        await world.keep_calendars()

    outcomes = await dispatch_fairly(world)

    assert outcomes[-1] != "failed"
    await world.end()
