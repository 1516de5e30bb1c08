"""A quote compares stations that are near a place; an accepted offer books its stations."""

from datetime import timedelta
from typing import Any

import pytest
from skyway_gateway.quotes.make_quote import ranked
from skyway_gateway.quotes.store import Offer

from skyway.delivery.qos import Weights
from tests.gateway.places.small_town import location, make_town
from tests.gateway.whole_gateway import Gateway, make_request


@pytest.fixture(autouse=True)
def _town(gateway: Gateway) -> None:
    gateway.parts.networks.cached.put(make_town())


def request_body(**changes: Any) -> dict[str, Any]:
    """A request for one package to a place near three stations."""
    body = make_request(**changes)
    body["packages"][0]["destination"] = location(east_m=5_200.0)
    return body


async def quoted(gateway: Gateway, body: dict[str, Any]) -> dict[str, Any]:
    answer = await gateway.http.post("/v1/quotes", json=body, headers=gateway.customer)
    assert answer.status_code == 201, answer.text
    quote: dict[str, Any] = answer.json()
    return quote


def ends(quote: dict[str, Any]) -> list[str]:
    """Where each offer hands the package over."""
    return [each["packages"][0]["destination_station_id"] for each in quote["offers"]]


async def test_offers_to_each_near_station_are_compared(gateway: Gateway) -> None:
    quote = await quoted(gateway, request_body())

    asked = [each.request.destinations for each in gateway.composition.quote_queries]
    assert asked == [("bulverde",), ("mcqueeney",), ("san-antonio",)]
    assert ends(quote) == ["bulverde", "mcqueeney", "san-antonio"]
    [place] = quote["places"]
    assert place["fields"] == ["packages.0.destination"]
    assert place["served_by"]["station_id"] == "bulverde"
    assert place["served_by"]["walk_m"] == pytest.approx(100.0, abs=0.2)
    assert [each["station_id"] for each in place["alternatives"]] == ["mcqueeney", "san-antonio"]
    shown = await gateway.http.get(f"/v1/quotes/{quote['quote_id']}", headers=gateway.customer)
    assert shown.json() == quote


async def test_at_most_three_variants_are_planned_those_with_the_shortest_walks(
    gateway: Gateway,
) -> None:
    east_m = {"mcqueeney": 5_200.0, "bulverde": 5_210.0, "san-antonio": 5_230.0, "dallas": 5_240.0}
    gateway.parts.networks.cached.put(
        make_town(east_m={"san-marcos": 0.0, "island": 15.0, **east_m})
    )

    await quoted(gateway, request_body(pickup=location(east_m=0.0)))

    asked = [
        (each.request.pickup.station_id, *each.request.destinations)
        for each in gateway.composition.quote_queries
    ]
    assert asked == [
        ("san-marcos", "mcqueeney"),
        ("san-marcos", "bulverde"),
        ("island", "mcqueeney"),
    ]


async def test_the_pickup_is_no_variant_of_a_destination(gateway: Gateway) -> None:
    await quoted(gateway, request_body(pickup={"station_id": "mcqueeney"}))

    asked = [each.request.destinations for each in gateway.composition.quote_queries]
    assert asked == [("bulverde",), ("san-antonio",)]


async def test_named_stations_are_not_compared(gateway: Gateway) -> None:
    quote = await quoted(gateway, make_request())

    assert len(gateway.composition.quote_queries) == 1
    assert quote["places"] == []
    assert quote["offers"][0]["score"] == 1.0


async def test_an_offer_books_the_stations_that_it_names(gateway: Gateway) -> None:
    quote = await quoted(gateway, request_body())
    other = quote["offers"][1]

    choice = {"quote_id": quote["quote_id"], "offer_id": other["offer_id"]}
    answer = await gateway.post(choice)
    await gateway.book_next()

    assert answer.status_code == 202, answer.text
    assert answer.json()["request"]["packages"][0]["destination"] == {"station_id": "mcqueeney"}
    assert gateway.composition.kept[-1].request.destinations == ("mcqueeney",)
    assert gateway.composition.asked[-1].request.destinations == ("mcqueeney",)
    assert (await gateway.get(answer.json()["delivery_id"]))["state"] == "PLANNED"


async def test_held_offers_are_for_the_nearest_station_alone(gateway: Gateway) -> None:
    quote = await quoted(gateway, request_body(hold=True))

    assert len(gateway.composition.holds) == 1
    assert ends(quote) == ["bulverde"]
    assert len(quote["places"][0]["alternatives"]) == 2


async def test_a_provider_with_an_offer_to_one_station_has_no_reason(
    gateway: Gateway, reason: Any
) -> None:
    gateway.registry.infeasible = [
        reason("NO_DRONES", is_temporary=False, provider_id=each) for each in ("prv_1", "prv_9")
    ]

    quote = await quoted(gateway, request_body())

    assert [each["provider_id"] for each in quote["infeasible"]] == ["prv_9"]


async def test_offers_of_several_variants_are_ranked_together(gateway: Gateway) -> None:
    quote = await quoted(gateway, request_body())
    near, far, _ = (Offer.model_validate(each) for each in quote["offers"])
    cheap = far.model_copy(update={"price": far.price.model_copy(update={"amount": 250})})
    at = gateway.clock.now()

    by_price = ranked((near, cheap), Weights(price=1), made_at=at)
    late = near.packages[0].model_copy(
        update={"eta_at": near.packages[0].eta_at + timedelta(hours=1)}
    )
    by_time = ranked(
        (near.model_copy(update={"packages": (late,)}), far), Weights(time=1), made_at=at
    )
    equal = ranked((near, far), Weights(time=1), made_at=at)

    assert [(each.price.amount, each.score) for each in by_price] == [(250, 1.0), (500, 2.0)]
    assert by_time[0].offer_id == far.offer_id
    assert [each.offer_id for each in equal] == [near.offer_id, far.offer_id]
