"""Changing times while a delivery is SCHEDULED: nothing is booked, so nothing has to be undone."""

import asyncio
from datetime import timedelta
from typing import Any, Final

import httpx
import pytest

from tests.gateway.whole_gateway import Gateway

PICKUP: Final = "2026-03-05T12:00:00Z"
EARLIER: Final = "2026-03-03T09:00:00Z"
LATER: Final = "2026-03-06T12:00:00Z"


async def scheduled(gateway: Gateway, **changes: Any) -> str:
    delivery_id = await gateway.accepted(packages=2, earliest_pickup_at=PICKUP, **changes)
    assert (await gateway.get(delivery_id))["state"] == "SCHEDULED"
    return delivery_id


async def change(gateway: Gateway, delivery_id: str, **body: object) -> httpx.Response:
    path = f"/v1/deliveries/{delivery_id}"
    return await gateway.http.patch(path, json=body, headers=gateway.customer)


async def test_a_delivery_gets_other_times(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await scheduled(gateway)
    of_p2 = {"package_id": "p2", "latest_at": LATER, "instructions": "Ring."}

    answer = await change(gateway, delivery_id, earliest_pickup_at=EARLIER, packages=[of_p2])

    assert answer.status_code == 200, answer.text
    shown = answer.json()
    assert await gateway.get(delivery_id) == shown
    assert shown["request"]["earliest_pickup_at"] == EARLIER
    assert shown["request"]["packages"][1]["latest_at"] == LATER
    *_, changed, again = await gateway.events(delivery_id)
    assert (changed["type"], again["type"]) == ("delivery.changed", "delivery.scheduled")
    names = ["packages.p2.instructions", "earliest_pickup_at", "packages.p2.latest_at"]
    assert changed["data"]["changed"] == names
    assert changed["data"]["request"]["earliest_pickup_at"] == EARLIER
    assert again["data"]["books_from_at"] == "2026-03-02T09:00:00.000Z"


async def test_it_is_booked_by_its_new_times(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await scheduled(gateway)

    await change(gateway, delivery_id, earliest_pickup_at="2026-03-01T13:00:00Z")
    await gateway.parts.schedule_opener.step()
    await gateway.book_next()

    assert (await gateway.get(delivery_id))["state"] == "PLANNED"
    asked = gateway.composition.asked[-1].request.earliest_pickup_at
    assert asked == gateway.clock.now() + timedelta(hours=1)
    types = await gateway.event_types(delivery_id)
    assert types.count("delivery.scheduled") == 1, "it is looked for immediately"


async def test_a_later_pickup_is_waited_for(gateway: Gateway) -> None:
    delivery_id = await scheduled(gateway)
    await change(gateway, delivery_id, earliest_pickup_at=LATER)
    gateway.clock.advance(timedelta(days=3, hours=1))

    await gateway.parts.schedule_opener.step()

    assert (await gateway.get(delivery_id))["state"] == "SCHEDULED"


async def test_new_times_are_checked_like_those_of_a_request(gateway: Gateway) -> None:
    delivery_id = await scheduled(gateway)
    for body, field, detail in (
        ({"earliest_pickup_at": "2027-01-01T00:00:00Z"}, "earliest_pickup_at", "30 days ahead"),
        ({"latest_pickup_at": EARLIER}, "latest_pickup_at", "is before earliest_pickup_at"),
        ({"earliest_pickup_at": None}, "earliest_pickup_at", "must be a moment, such as now"),
        ({"earliest_pickup_at": "tomorrow"}, "earliest_pickup_at", "must be a moment like"),
    ):
        answer = await change(gateway, delivery_id, **body)

        assert answer.status_code == 422
        [error] = answer.json()["errors"]
        assert error["field"] == field
        assert detail in error["detail"]


async def test_a_dry_run_checks_new_times_and_keeps_the_old_ones(gateway: Gateway) -> None:
    delivery_id = await scheduled(gateway)

    answer = await change(gateway, delivery_id, earliest_pickup_at=LATER, dry_run=True)

    assert answer.json()["request"]["earliest_pickup_at"] == LATER
    assert (await gateway.get(delivery_id))["request"]["earliest_pickup_at"] == PICKUP


async def test_the_moment_of_booking_decides_between_old_and_new_times(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    delivery_id = await scheduled(gateway)
    gateway.clock.advance(timedelta(days=3))

    answer, _ = await asyncio.gather(
        change(gateway, delivery_id, earliest_pickup_at=LATER),
        gateway.parts.schedule_opener.step(),
    )

    delivery = await gateway.get(delivery_id)
    found = answer.status_code, delivery["state"], delivery["request"]["earliest_pickup_at"]
    assert found in ((200, "SCHEDULED", LATER), (409, "REQUESTED", PICKUP))


@pytest.mark.parametrize("second", [LATER, EARLIER], ids=["the same", "another one"])
async def test_two_new_times_at_the_same_time_apply_or_are_refused(
    gateway: Gateway, second: str
) -> None:
    delivery_id = await scheduled(gateway)

    answers = await asyncio.gather(
        change(gateway, delivery_id, earliest_pickup_at=LATER),
        change(gateway, delivery_id, earliest_pickup_at=second),
    )

    assert {answer.status_code for answer in answers} <= {200, 409}
    applied = [a.json()["request"]["earliest_pickup_at"] for a in answers if a.is_success]
    assert (await gateway.get(delivery_id))["request"]["earliest_pickup_at"] in applied
