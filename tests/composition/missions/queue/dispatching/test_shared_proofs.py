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
from tests.composition.missions.queue.booked_chain import reports_of
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
