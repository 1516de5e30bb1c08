"""A request with a pickup beyond the booking horizon waits as SCHEDULED and holds nothing."""

from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from pydantic import ValidationError
from skyway_gateway.deliveries.booking.horizon import books_from
from skyway_gateway.settings import GatewaySettings

from skyway.delivery.request import DeliveryRequest
from tests.gateway.whole_gateway import START, Gateway, make_request


async def scheduled(gateway: Gateway, *, hours: float = 72, **changes: Any) -> str:
    """The id of a delivery with a pickup so many hours ahead."""
    pickup_at = (gateway.clock.now() + timedelta(hours=hours)).isoformat()
    return await gateway.accepted(earliest_pickup_at=pickup_at, **changes)


async def test_a_pickup_beyond_the_horizon_waits_as_scheduled(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both

    delivery_id = await scheduled(gateway)

    assert (await gateway.get(delivery_id))["state"] == "SCHEDULED"
    assert not await gateway.book_next()
    assert gateway.composition.asked == []
    requested, event = await gateway.events(delivery_id)
    assert requested["type"] == "delivery.requested"
    assert event["type"] == "delivery.scheduled"
    assert event["data"] == {
        "earliest_pickup_at": "2026-03-04T12:00:00.000Z",
        "books_from_at": "2026-03-03T12:00:00.000Z",
    }


async def test_a_request_whose_windows_all_open_later_waits_as_scheduled(gateway: Gateway) -> None:
    opens_at = (gateway.clock.now() + timedelta(hours=72)).isoformat()

    delivery_id = await gateway.accepted(window={"not_before_at": opens_at})

    assert (await gateway.get(delivery_id))["state"] == "SCHEDULED"
    assert (await gateway.events(delivery_id))[-1]["data"]["books_from_at"] == (
        "2026-03-03T12:00:00.000Z"
    )


async def test_a_pickup_within_the_horizon_is_booked_immediately(gateway: Gateway) -> None:
    delivery_id = await scheduled(gateway, hours=24)

    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    assert await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "PLANNED"


async def test_it_is_booked_when_its_pickup_comes_within_the_horizon(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    delivery_id = await scheduled(gateway)

    gateway.clock.advance(timedelta(hours=47))
    await gateway.parts.schedule_opener.step()
    assert (await gateway.get(delivery_id))["state"] == "SCHEDULED"

    gateway.clock.advance(timedelta(hours=1))
    await gateway.parts.schedule_opener.step()
    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    assert await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "PLANNED"


async def test_two_replicas_request_it_once(gateway: Gateway) -> None:
    delivery_id = await scheduled(gateway)
    gateway.clock.advance(timedelta(hours=60))

    await gateway.parts.schedule_opener.step()
    assert await gateway.book_next()
    planned = await gateway.get(delivery_id)
    await gateway.parts.schedule_opener.step()

    assert await gateway.get(delivery_id) == planned
    assert gateway.composition.booking_count == 1


async def test_a_changed_horizon_counts_for_deliveries_that_wait_already(gateway: Gateway) -> None:
    delivery_id = await scheduled(gateway)
    opener = replace(gateway.parts.schedule_opener, horizon=timedelta(hours=100))

    await opener.step()

    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"


async def test_it_is_given_up_an_hour_after_its_pickup(gateway: Gateway) -> None:
    delivery_id = await scheduled(gateway)
    gateway.composition.is_busy = True
    gateway.clock.advance(timedelta(hours=72, minutes=59))
    await gateway.parts.schedule_opener.step()

    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    # The hour began when the delivery was requested: the gateway was away until then.
    gateway.clock.advance(timedelta(hours=1))
    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "REJECTED"


async def test_a_scheduled_delivery_can_be_cancelled(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await scheduled(gateway, packages=2)
    path = f"/v1/deliveries/{delivery_id}/cancel"

    one = await gateway.http.post(path, json={"package_ids": ["p1"]}, headers=gateway.customer)
    assert one.json()["state"] == "SCHEDULED"
    both = await gateway.http.post(path, headers=gateway.customer)

    assert both.json()["state"] == "CANCELLED"
    gateway.clock.advance(timedelta(hours=60))
    await gateway.parts.schedule_opener.step()
    assert not await gateway.book_next()
    assert (await gateway.event_types(delivery_id))[-1] == "delivery.cancelled"


async def test_a_cancellation_whose_process_died_is_finished(gateway: Gateway) -> None:
    delivery_id = await scheduled(gateway)
    await gateway.execute("UPDATE deliveries SET cancel_reason = 'ordered twice'")

    await gateway.parts.schedule_opener.step()
    assert await gateway.book_next()

    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "CANCELLED"
    assert delivery["packages"][0]["detail"] == "ordered twice"


async def test_an_accepted_offer_with_a_late_pickup_waits_too(gateway: Gateway) -> None:
    body = make_request(earliest_pickup_at=(START + timedelta(hours=72)).isoformat())
    quote = (await gateway.http.post("/v1/quotes", json=body, headers=gateway.customer)).json()
    chosen = {"quote_id": quote["quote_id"], "offer_id": quote["offers"][0]["offer_id"]}

    accepted = (await gateway.post(chosen)).json()

    assert accepted["state"] == "SCHEDULED"
    assert accepted["offer"]["provider_id"] == "prv_1"


@pytest.mark.parametrize("days", [30.1, 366])
async def test_a_pickup_more_than_thirty_days_ahead_is_refused(
    gateway: Gateway, days: float
) -> None:
    pickup_at = START + timedelta(days=days)

    answer = await gateway.post(make_request(earliest_pickup_at=pickup_at.isoformat()))

    assert answer.status_code == 422
    [error] = answer.json()["errors"]
    assert error["field"] == "earliest_pickup_at"
    assert "the limit of 2026-03-31 12:00:00+00:00, 30 days ahead" in error["detail"]


@pytest.mark.parametrize("hours", [0, -1, float("nan"), float("inf"), 721])
def test_a_horizon_that_is_no_span_up_to_thirty_days_is_refused(hours: float) -> None:
    with pytest.raises(ValidationError, match="booking_horizon_h"):
        GatewaySettings.model_validate(
            {"database_url": "sqlite:///x", "mqtt_url": "mqtt://x", "booking_horizon_h": hours}
        )


def test_a_request_without_an_earliest_pickup_is_never_scheduled() -> None:
    request = DeliveryRequest.model_validate(make_request())
    assert books_from(request, timedelta(hours=24)) is None
