"""A delivery whose packages are handed over at another station keeps that pickup."""

from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any, Final

from skyway.ids import DeliveryId
from tests.gateway.whole_gateway import Gateway

_NEAR: Final = {"pooling": True, "pickup_within_m": 1_000}


async def _met_elsewhere(gateway: Gateway) -> DeliveryId:
    """A delivery that shares a trip from mcqueeney, which is 900 m from its own pickup."""
    gateway.composition.near_pickup = ("mcqueeney", 900.0)
    delivery_id = await gateway.accepted(qos=_NEAR, packages=2)
    await gateway.book_next()
    return delivery_id


async def test_a_customer_reads_where_the_packages_are_handed_over(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    delivery_id = await _met_elsewhere(gateway)

    delivery = await gateway.get(delivery_id)
    assert delivery["pickup"] == {"station_id": "mcqueeney"}
    assert delivery["request"]["pickup"] == {"station_id": "san-marcos"}
    custodians = [each["custodian"] for each in delivery["packages"]]
    assert custodians == [{"kind": "STATION", "id": "mcqueeney"}] * 2
    _, planned = await gateway.events(delivery_id)
    assert planned["data"]["pickup_station_id"] == "mcqueeney"
    assert await gateway.broken() == []

    await gateway.report(delivery_id, "LOADED", seq=1)
    assert (await gateway.get(delivery_id))["pickup"] == {"station_id": "mcqueeney"}


async def test_a_delivery_that_loses_its_drone_is_booked_from_where_its_packages_are(
    gateway: Gateway, candidate: Callable[..., Any]
) -> None:
    gateway.registry.candidates_now = [candidate("drn_1"), candidate("drn_2")]
    delivery_id = await _met_elsewhere(gateway)
    _, planned = await gateway.events(delivery_id)
    gateway.clock.advance(timedelta(seconds=10))
    await gateway.report(delivery_id, "REFUSED", seq=1)
    assert (await gateway.get(delivery_id))["pickup"] == {"station_id": "mcqueeney"}
    await gateway.book_next()

    first, second = gateway.composition.asked
    assert first.request.pickup.station_id == "san-marcos"
    assert second.request.pickup.station_id == "mcqueeney"
    # No drone loads before the moment that the first booking has promised.
    booked_at = datetime.fromisoformat(planned["data"]["pickup_at"])
    assert second.request.earliest_pickup_at == booked_at
    assert gateway.registry.queries[-1].pickup_station_id == "mcqueeney"
    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["attempt"]) == ("PLANNED", 2)
    assert delivery["pickup"] == {"station_id": "mcqueeney"}
    assert await gateway.broken() == []

    await gateway.report(delivery_id, "REFUSED", seq=1, attempt=2)
    await gateway.book_next()
    assert gateway.composition.asked[-1].request.pickup.station_id == "mcqueeney"
    assert gateway.composition.asked[-1].request.earliest_pickup_at == booked_at


async def test_a_delivery_that_loses_its_drone_waits_until_its_customer_can_be_there(
    gateway: Gateway,
) -> None:
    gateway.composition.starts_after = timedelta(hours=10)
    delivery_id = await _met_elsewhere(gateway)
    booked = gateway.composition.booked
    mission = booked[delivery_id, 1]
    booked[delivery_id, 1] = mission.model_copy(update={"state": "REFUSED"})
    await gateway.report(delivery_id, "REFUSED", seq=1)
    gateway.registry.candidates_now = []
    gateway.clock.advance(timedelta(hours=9))
    await gateway.book_next()

    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"


async def test_a_package_that_is_cancelled_stays_at_the_pickup_of_its_mission(
    gateway: Gateway,
) -> None:
    delivery_id = await _met_elsewhere(gateway)

    await gateway.report(delivery_id, "RELEASED", seq=1, package_ids=("p1",), code="CANCELLED")

    delivery = await gateway.get(delivery_id)
    assert delivery["packages"][0]["custodian"] == {"kind": "STATION", "id": "mcqueeney"}
    assert delivery["pickup"] == {"station_id": "mcqueeney"}
    assert await gateway.broken() == []
