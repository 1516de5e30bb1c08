"""Accepting an offer: it is booked within its limits immediately, or rejected with the reason."""

from collections.abc import Callable
from datetime import timedelta
from typing import Any

import httpx
import pytest

from skyway.delivery.offer import Tariff
from tests.gateway.peers import make_candidate
from tests.gateway.whole_gateway import Gateway


async def quoted(gateway: Gateway, body: dict[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """A quote, and the choice of its best offer."""
    answer = await gateway.http.post("/v1/quotes", json=body, headers=gateway.customer)
    assert answer.status_code in (200, 201), answer.text
    quote = answer.json()
    return quote, {"quote_id": quote["quote_id"], "offer_id": quote["offers"][0]["offer_id"]}


async def taken(gateway: Gateway, choice: dict[str, str], **headers: str) -> httpx.Response:
    answer: httpx.Response = await gateway.post(choice, **headers)
    return answer


async def test_an_accepted_offer_is_booked_within_its_limits(
    gateway_on_both: Gateway, request_body: Callable[..., dict[str, Any]]
) -> None:
    gateway = gateway_on_both
    quote, choice = await quoted(gateway, request_body(packages=2))
    answer = await taken(gateway, choice)
    assert answer.status_code == 202, answer.text
    delivery = answer.json()
    offer = quote["offers"][0]
    assert delivery["request"] == quote["request"]
    assert delivery["offer"] == {
        "provider_id": offer["provider_id"],
        "price": offer["price"],
        "within_s": offer["delivery_time_s"],
        "hold": {"hold_id": gateway.composition.kept[0].hold_id, "number": 0},
        "tariff": offer["tariff"],
        "late_share": None,
    }
    await gateway.book_next()
    assert (await gateway.get(delivery["delivery_id"]))["state"] == "PLANNED"
    asked = gateway.composition.asked[-1]
    assert asked.offer is not None
    assert asked.offer.price.amount == offer["price"]["amount"]
    assert gateway.registry.queries[-1].providers.pinned == offer["provider_id"]


async def test_an_offer_is_kept_and_booked_by_the_tariff_of_its_quote(
    gateway_on_both: Gateway, request_body: Callable[..., dict[str, Any]]
) -> None:
    gateway = gateway_on_both
    quote, choice = await quoted(gateway, request_body())
    assert quote["offers"][0]["tariff"]["base"] == 500
    raised = Tariff(base=50_000, currency="EUR")
    gateway.registry.candidates_now = [make_candidate().model_copy(update={"tariff": raised})]

    delivery = (await taken(gateway, choice)).json()
    await gateway.book_next()

    for asked in (gateway.composition.kept[-1], gateway.composition.asked[-1]):
        assert [each.tariff for each in asked.candidates] == [Tariff(base=500)]
    assert (await gateway.get(delivery["delivery_id"]))["state"] == "PLANNED"
    later, _ = await quoted(gateway, request_body())
    assert later["offers"][0]["tariff"]["currency"] == "EUR"


async def test_one_offer_of_a_quote_is_accepted_once(
    gateway: Gateway, request_body: Callable[..., dict[str, Any]]
) -> None:
    _, choice = await quoted(gateway, request_body())
    first = await taken(gateway, choice, **{"Idempotency-Key": "k"})
    again = await taken(gateway, choice, **{"Idempotency-Key": "k"})
    assert (again.status_code, again.json()) == (202, first.json())
    other = await taken(gateway, choice)
    assert (other.status_code, other.json()["code"]) == (409, "QUOTE_TAKEN")


async def test_an_expired_offer_is_refused_immediately(
    gateway: Gateway, request_body: Callable[..., dict[str, Any]]
) -> None:
    _, choice = await quoted(gateway, request_body())
    gateway.clock.advance(timedelta(seconds=121))
    answer = await taken(gateway, choice)
    assert (answer.status_code, answer.json()["code"]) == (409, "QUOTE_EXPIRED")


async def test_an_offer_can_be_accepted_after_a_service_was_away(
    gateway: Gateway, request_body: Callable[..., dict[str, Any]]
) -> None:
    _, choice = await quoted(gateway, request_body())
    gateway.composition.is_away = True
    assert (await taken(gateway, choice)).status_code == 503
    gateway.composition.is_away = False
    assert (await taken(gateway, choice)).status_code == 202


async def test_an_offer_of_another_customer_is_not_found(
    gateway: Gateway, request_body: Callable[..., dict[str, Any]]
) -> None:
    _, choice = await quoted(gateway, request_body())
    theirs = await gateway.http.post("/v1/deliveries", json=choice, headers=gateway.other)
    assert theirs.status_code == 404
    unknown = await taken(gateway, {**choice, "offer_id": "off_unknown"})
    assert unknown.status_code == 404


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"quote_id": "q"}, "offer_id"),
        ({"offer_id": "o"}, "quote_id"),
        ({"quote_id": "q", "offer_id": "o", "reference": "r"}, "reference"),
        ({"quote_id": "no id!", "offer_id": "o"}, "quote_id"),
        ({"reference": "r"}, "pickup"),
    ],
)
async def test_a_body_that_is_neither_form_names_its_fields(
    gateway: Gateway, body: dict[str, Any], field: str
) -> None:
    answer = await gateway.post(body)
    assert answer.status_code == 422, answer.text
    assert answer.json()["errors"][0]["field"] == field


@pytest.mark.parametrize("is_busy", [True, False], ids=["busy", "infeasible"])
async def test_a_delivery_of_a_lost_offer_is_rejected_in_one_round(
    gateway_on_both: Gateway,
    request_body: Callable[..., dict[str, Any]],
    reason: Callable[..., Any],
    is_busy: bool,
) -> None:
    gateway = gateway_on_both
    _, choice = await quoted(gateway, request_body())
    delivery_id = (await taken(gateway, choice)).json()["delivery_id"]
    gateway.composition.is_busy = is_busy
    why = reason("NO_PAD_IN_TIME", is_temporary=is_busy)
    after_acceptance = {"data": {"hold_loss": "NETWORK_CHANGED"}}
    gateway.composition.reasons = [why.model_copy(update=after_acceptance)]
    await gateway.book_next()
    delivery = await gateway.get(delivery_id)
    assert delivery["state"] == "REJECTED"
    codes = [one["code"] for one in delivery["reasons"]]
    assert codes == ["OFFER_LOST", "NO_PAD_IN_TIME"]
    assert delivery_id in gateway.composition.closed


async def test_an_accepted_offer_survives_a_service_that_is_away(
    gateway: Gateway, request_body: Callable[..., dict[str, Any]]
) -> None:
    _, choice = await quoted(gateway, request_body())
    delivery_id = (await taken(gateway, choice)).json()["delivery_id"]
    gateway.composition.is_away = True
    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "REQUESTED"
    gateway.composition.is_away = False
    gateway.clock.advance(timedelta(seconds=3))
    await gateway.book_next()
    assert (await gateway.get(delivery_id))["state"] == "PLANNED"


async def test_a_refused_trip_of_an_offer_is_booked_within_the_remaining_price(
    gateway: Gateway, request_body: Callable[..., dict[str, Any]], candidate: Callable[..., Any]
) -> None:
    gateway.registry.candidates_now = [candidate("drn_1"), candidate("drn_2")]
    quote, choice = await quoted(gateway, request_body(packages=2))
    delivery_id = (await taken(gateway, choice)).json()["delivery_id"]
    gateway.composition.packages_per_trip = 1
    await gateway.book_next()
    await gateway.report(delivery_id, "REFUSED", seq=1, trip=2, code="EXPIRED")
    await gateway.book_next()
    asked = gateway.composition.asked[-1]
    left = max(0, quote["offers"][0]["price"]["amount"] - 1234)
    assert asked.offer is not None
    assert asked.offer.price.amount == left
    assert [package.package_id for package in asked.request.packages] == ["p2"]
