"""What customers pay for what was delivered, cancelled, lost and late."""

from datetime import timedelta
from typing import Any

import pytest

from tests.gateway.ledger.paid_world import asked, booked, delivered, flown, handed_over
from tests.gateway.whole_gateway import Gateway


def items_of(price: dict[str, Any]) -> dict[str, int]:
    """The amounts of a price by kind; they sum to it."""
    items = {each["kind"]: each["amount"] for each in price["line_items"]}
    assert sum(items.values()) == price["amount"]
    return items


async def cancelled(gateway: Gateway, delivery_id: str, *package_ids: str) -> dict[str, Any]:
    body = {"package_ids": list(package_ids)} if package_ids else None
    path = f"/v1/deliveries/{delivery_id}/cancel"
    answer = await gateway.http.post(path, json=body, headers=gateway.customer)
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


async def test_a_delivery_in_time_costs_its_price(gateway_on_both: Gateway) -> None:
    delivery_id = await delivered(gateway_on_both)

    delivery = await gateway_on_both.get(delivery_id)

    assert items_of(delivery["price"]) == {"BASE": 500, "DISTANCE": 734}
    assert delivery["missions"][0]["charged"] == delivery["price"]
    [line, _] = await asked(gateway_on_both, "/lines")
    assert (line["kind"], line["amount"], line["customer_id"]) == ("BASE", 500, "alice")


@pytest.mark.parametrize(
    ("minutes", "refund"), [(10, 0), (10.1, -123), (60, -123), (61, -617), (6000, -617)]
)
async def test_a_late_delivery_gives_back_the_share_of_the_last_step_that_it_passed(
    gateway: Gateway, minutes: float, refund: int
) -> None:
    delivery_id = await delivered(gateway, later=timedelta(minutes=minutes))

    price = (await gateway.get(delivery_id))["price"]

    assert price["amount"] == 1234 + refund
    assert items_of(price).get("LATENESS", 0) == refund


async def test_the_last_event_says_what_the_customer_pays(gateway: Gateway) -> None:
    delivery_id = await delivered(gateway, later=timedelta(hours=2))

    last = (await gateway.events(delivery_id))[-1]

    assert last["type"] == "delivery.completed"
    assert last["data"]["price"]["amount"] == 617


async def test_a_request_that_is_cancelled_before_it_is_booked_is_free(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted()

    assert (await cancelled(gateway, delivery_id))["price"] is None
    assert await asked(gateway, "/lines") == []


async def test_a_booked_delivery_that_is_cancelled_costs_its_first_share(gateway: Gateway) -> None:
    delivery_id = await booked(gateway, packages=2)

    price = (await cancelled(gateway, delivery_id))["price"]

    assert price["amount"] == 1234 - 926
    assert items_of(price) == {"BASE": 500, "DISTANCE": 734, "CANCELLATION": -926}


async def test_a_delivery_that_is_cancelled_in_flight_costs_its_second_share(
    gateway: Gateway,
) -> None:
    delivery_id = await booked(gateway)
    await flown(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    gateway.composition.loaded = {"p1"}

    under_way = await cancelled(gateway, delivery_id)
    back: dict[str, Any] = {"package_ids": ["p1"], "code": "CANCELLED"}
    await gateway.report(delivery_id, "RETURNING", seq=4, **back)
    await gateway.report(delivery_id, "RETURNED", seq=5, station_id="san-marcos", **back)

    assert under_way["price"]["amount"] == 1234, "charged before the packages are back"
    assert (await gateway.get(delivery_id))["price"]["amount"] == 1234 - 247


async def test_cancelling_some_packages_of_a_trip_gives_nothing_back(gateway: Gateway) -> None:
    """The drone flies anyway: packages cannot be added and cancelled to lower the price."""
    delivery_id = await booked(gateway, packages=3)
    await cancelled(gateway, delivery_id, "p2", "p3")
    await flown(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    await handed_over(gateway, delivery_id)

    assert (await gateway.get(delivery_id))["price"]["amount"] == 1234


async def test_a_package_that_its_drone_lost_is_given_back(gateway: Gateway) -> None:
    delivery_id = await booked(gateway, packages=3)
    await flown(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    await handed_over(gateway, delivery_id)
    lost: dict[str, Any] = {
        "stranded_package_ids": ["p2", "p3"],
        "station_id": "bulverde",
        "code": "BATTERY",
    }
    await gateway.report(delivery_id, "ENDED", seq=5, mission_state="ABORTED", **lost)

    price = (await gateway.get(delivery_id))["price"]

    assert items_of(price) == {"BASE": 500, "DISTANCE": 734, "FAILURE": -822}


@pytest.mark.parametrize(
    ("code", "amount"), [("BATTERY", 0), ("RECIPIENT_ABSENT", 987), ("LOADING_TIMEOUT", 987)]
)
async def test_a_package_that_comes_back_is_free_unless_its_customer_is_the_cause(
    gateway: Gateway, code: str, amount: int
) -> None:
    delivery_id = await booked(gateway)
    await flown(gateway, delivery_id, "ACCEPTED", "LOADING", "LOADED")
    back: dict[str, Any] = {"package_ids": ["p1"], "code": code, "station_id": "san-marcos"}
    await gateway.report(delivery_id, "RETURNING", seq=4, **back)
    await gateway.report(delivery_id, "RETURNED", seq=5, **back)

    assert (await gateway.get(delivery_id))["price"]["amount"] == amount


async def test_a_refused_mission_is_not_charged(gateway: Gateway) -> None:
    delivery_id = await booked(gateway)
    await gateway.report(delivery_id, "REFUSED", seq=1, code="LOW_BATTERY")

    assert await asked(gateway, "/lines") == []


async def test_a_drone_that_refuses_a_cancelled_mission_changes_no_charge(
    gateway: Gateway,
) -> None:
    delivery_id = await booked(gateway)
    await cancelled(gateway, delivery_id)

    await gateway.report(delivery_id, "REFUSED", seq=1, code="LOW_BATTERY")

    assert (await gateway.get(delivery_id))["price"]["amount"] == 308


async def test_a_report_that_comes_twice_is_charged_once(gateway: Gateway) -> None:
    delivery_id = await delivered(gateway)
    await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"])

    assert len(await asked(gateway, "/lines", delivery_id=delivery_id)) == 2
