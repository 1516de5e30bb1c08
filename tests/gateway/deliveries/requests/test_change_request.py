"""Changing what a delivery is flown for: it is booked anew until a drone has its mission."""

import asyncio
from typing import Any, Final

import pytest

from skyway.delivery.offer import Price
from tests.gateway.deliveries.requests.test_change import change, changes_of
from tests.gateway.whole_gateway import Gateway

ELSEWHERE: Final = {"package_id": "p1", "destination": {"station_id": "san-antonio"}}
LATER: Final = "2026-03-06T12:00:00Z"


async def booked(gateway: Gateway) -> None:
    while await gateway.book_next():
        pass


async def accepted_offer(gateway: Gateway, **changes: Any) -> str:
    """A delivery with an accepted offer."""
    body = {
        "pickup": {"station_id": "san-marcos"},
        "packages": [
            {"package_id": "p1", "mass_kg": 0.4, "destination": {"station_id": "mcqueeney"}}
        ],
        **changes,
    }
    headers = gateway.customer
    quote = (await gateway.http.post("/v1/quotes", json=body, headers=headers)).json()
    chosen = {"quote_id": quote["quote_id"], "offer_id": quote["offers"][0]["offer_id"]}
    return str((await gateway.post(chosen)).json()["delivery_id"])


async def test_a_booked_delivery_gets_another_destination(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned()
    created_at = (await gateway.get(delivery_id))["created_at"]

    answer = await change(gateway, delivery_id, packages=[{**ELSEWHERE, "mass_kg": 0.7}])

    assert answer.status_code == 200, answer.text
    shown = answer.json()
    assert await gateway.get(delivery_id) == shown
    assert (shown["state"], shown["missions"], shown["price"]) == ("REQUESTED", [], None)
    assert (shown["attempt"], shown["created_at"]) == (2, created_at)
    [package] = shown["packages"]
    assert (package["destination"], package["mass_kg"]) == (ELSEWHERE["destination"], 0.7)
    assert package["promised_at"] is None
    [data] = await changes_of(gateway, delivery_id)
    assert data["changed"] == ["packages.p1.destination", "packages.p1.mass_kg"]
    assert data["request"]["packages"][0]["mass_kg"] == 0.7
    await booked(gateway)
    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["missions"][0]["attempt"]) == ("PLANNED", 2)
    assert gateway.composition.asked[-1].request.packages[0].mass_kg == 0.7
    # The report that the first mission is given up comes late, and changes nothing.
    given_up: dict[str, Any] = {"mission_state": "REFUSED", "code": "CHANGED"}
    assert (await gateway.report(delivery_id, "REFUSED", seq=1, **given_up)).status_code == 204
    assert (await gateway.get(delivery_id))["state"] == "PLANNED"
    assert await gateway.broken() == []


async def test_a_booked_delivery_gets_and_loses_a_proof(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    signed = {"package_id": "p1", "dropoff_verification": {"method": "SIGNATURE", "wait_s": 120}}

    asked = (await change(gateway, delivery_id, packages=[signed])).json()
    await booked(gateway)
    booked_with = gateway.composition.asked[-1].request.packages[0].dropoff_verification
    without = {"package_id": "p1", "dropoff_verification": None}
    after = (await change(gateway, delivery_id, packages=[without])).json()

    assert asked["packages"][0]["dropoff_proof"]["method"] == "SIGNATURE"
    assert booked_with is not None
    assert (booked_with.method, booked_with.wait_s) == ("SIGNATURE", 120)
    assert after["packages"][0]["dropoff_proof"] is None
    assert [data["changed"] for data in await changes_of(gateway, delivery_id)] == [
        ["packages.p1.dropoff_verification"],
        ["packages.p1.dropoff_verification"],
    ]


async def test_a_delivery_whose_drone_has_left_stays_as_it_is(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    gateway.composition.has_left.add(delivery_id)
    before = await gateway.get(delivery_id)

    answer = await change(gateway, delivery_id, packages=[ELSEWHERE])

    assert (answer.status_code, answer.json()["code"]) == (409, "TOO_LATE")
    assert await gateway.get(delivery_id) == before
    assert await changes_of(gateway, delivery_id) == []


async def test_words_change_although_the_drone_has_left(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    gateway.composition.has_left.add(delivery_id)

    answer = await change(gateway, delivery_id, instructions="Ring twice.")

    assert answer.status_code == 200


async def test_a_change_to_what_is_already_so_keeps_the_booking(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    before = await gateway.get(delivery_id)
    same = [{"package_id": "p1", "destination": before["packages"][0]["destination"]}]

    answer = await change(gateway, delivery_id, packages=same, qos={"priority": "STANDARD"})

    assert answer.status_code == 200
    assert await gateway.get(delivery_id) == before


async def test_a_postponed_delivery_is_scheduled_again(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()

    shown = (await change(gateway, delivery_id, earliest_pickup_at=LATER)).json()

    assert (shown["state"], shown["request"]["earliest_pickup_at"]) == ("SCHEDULED", LATER)
    assert (await gateway.event_types(delivery_id))[-2:] == [
        "delivery.changed",
        "delivery.scheduled",
    ]
    assert not await gateway.book_next()


async def test_a_dry_run_shows_the_price_and_keeps_the_booking(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    before = await gateway.get(delivery_id)

    answer = await change(gateway, delivery_id, packages=[ELSEWHERE], dry_run=True)

    shown = answer.json()
    assert shown["packages"][0]["destination"] == ELSEWHERE["destination"]
    assert shown["price"]["amount"] > 0
    assert shown["price"] != before["price"]
    assert await gateway.get(delivery_id) == before
    assert gateway.composition.withdrawn == {}


async def test_an_accepted_offer_is_promised_anew_by_its_tariff(gateway: Gateway) -> None:
    delivery_id = await accepted_offer(gateway)
    accepted = (await gateway.get(delivery_id))["offer"]
    [candidate] = gateway.registry.candidates_now
    dearer = candidate.tariff.model_copy(update={"base": candidate.tariff.base + 500})
    price = Price(amount=accepted["price"]["amount"] + 300, currency="USD")
    gateway.composition.offered["price"] = price
    gateway.registry.candidates_now[:] = [candidate.model_copy(update={"tariff": dearer})]

    shown = (await change(gateway, delivery_id, packages=[ELSEWHERE])).json()

    query = gateway.composition.quote_queries[-1]
    asked = {each.provider_id: each.tariff for each in query.shortlist.providers}
    assert asked[accepted["provider_id"]].model_dump(mode="json") == accepted["tariff"]
    assert shown["offer"]["provider_id"] == accepted["provider_id"]
    assert shown["offer"]["tariff"] == accepted["tariff"]
    assert shown["offer"]["price"]["amount"] == price.amount
    assert (await gateway.get(delivery_id))["offer"] == shown["offer"]


async def test_without_an_offer_of_its_provider_the_promise_stays(gateway: Gateway) -> None:
    delivery_id = await accepted_offer(gateway)
    before = await gateway.get(delivery_id)
    gateway.registry.candidates_now.clear()

    answer = await change(gateway, delivery_id, packages=[ELSEWHERE])

    assert (answer.status_code, answer.json()["code"]) == (409, "NO_OFFER")
    assert await gateway.get(delivery_id) == before


@pytest.mark.parametrize(
    ("wrong", "field", "detail"),
    [
        ({"destination": {"station_id": "nowhere"}}, "destination.station_id", "nowhere"),
        ({"destination": {"station_id": "san-marcos"}}, "destination.station_id", "is the pickup"),
        ({"destination": None}, "destination", "may be left out, but not null"),
        ({"mass_kg": 900.0}, "mass_kg", "exceeds the"),
        ({"mass_kg": -1}, "mass_kg", "must be at least 0"),
        ({"dangerous_class": "9"}, "dangerous_class", "if, and only if, handling has DANGEROUS"),
    ],
)
async def test_an_impossible_request_is_refused_with_the_field_of_the_change(
    gateway: Gateway, wrong: dict[str, Any], field: str, detail: str
) -> None:
    delivery_id = await gateway.accepted(packages=2)

    answer = await change(gateway, delivery_id, packages=[{"package_id": "p2", **wrong}])

    assert answer.status_code == 422
    [error] = answer.json()["errors"]
    assert error["field"] == f"packages.0.{field}"
    assert detail in error["detail"]


async def test_two_changes_at_the_same_time_apply_both_or_one_is_refused(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned()

    answers = await asyncio.gather(
        change(gateway, delivery_id, packages=[ELSEWHERE]),
        change(gateway, delivery_id, packages=[{"package_id": "p1", "mass_kg": 0.7}]),
    )

    assert {each.status_code for each in answers} <= {200, 409}
    changed = [data["changed"] for data in await changes_of(gateway, delivery_id)]
    assert len(changed) == [each.status_code for each in answers].count(200)
    await booked(gateway)
    asked = gateway.composition.asked[-1].request.packages[0]
    assert (asked.mass_kg == 0.7) == (["packages.p1.mass_kg"] in changed)
    assert await gateway.broken() == []


async def test_a_change_that_dies_half_way_leaves_the_delivery_to_be_booked(
    gateway: Gateway,
) -> None:
    delivery_id = await gateway.accepted()
    gateway.composition.withdrawn[delivery_id] = 1  # and then the process was killed

    await booked(gateway)

    delivery = await gateway.get(delivery_id)
    assert (delivery["state"], delivery["missions"][0]["attempt"]) == ("PLANNED", 2)


async def test_nothing_changes_while_composition_is_away(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    before = await gateway.get(delivery_id)
    gateway.composition.is_away = True

    answer = await change(gateway, delivery_id, packages=[{"package_id": "p1", "mass_kg": 0.7}])

    assert answer.status_code == 503
    assert await gateway.get(delivery_id) == before
