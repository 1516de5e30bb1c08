"""A network's price ceiling: dearer drones are offered, but not booked without a `max_price`."""

from typing import Any

import pytest

from skyway.contracts.mission import BookMissions, OfferLimits
from skyway.contracts.quote import QuoteAnswer, QuoteQuery
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import Tariff

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

CEILING = 5_000


@pytest.fixture
async def dear(composition: Any, make: Any) -> Any:
    """A drone that is dearer than the ceiling of the network."""
    await composition.publish(make.network(price_ceiling=CEILING))
    return make.candidate(1, tariff=Tariff(base=90_000, per_km=10))


async def test_a_dear_drone_is_not_booked_without_a_max_price(composition: Any, dear: Any) -> None:
    booking = await composition.book(dear)

    assert booking.outcome == "INFEASIBLE"
    assert [reason.code for reason in booking.reasons] == ["TOO_EXPENSIVE"]
    assert booking.reasons[0].data["max_price"] == CEILING


async def test_a_cheaper_drone_is_booked_instead(composition: Any, make: Any, dear: Any) -> None:
    cheap = make.candidate(2, provider_id="prv_2", station_id="b", tariff=Tariff(base=100))

    booking = await composition.book(dear, cheap)

    assert [mission.provider_id for mission in booking.missions] == ["prv_2"]


async def test_a_dear_drone_is_booked_with_a_higher_max_price(
    composition: Any, make: Any, dear: Any
) -> None:
    request = make.request("c", qos={"max_price": 200_000})

    booking = await composition.book(dear, request=request)

    assert booking.outcome == "BOOKED"


async def test_a_quote_shows_the_dear_drone_and_its_offer_can_be_booked(
    composition: Any, make: Any, dear: Any
) -> None:
    shortlist, request = Shortlist.of([dear]), make.request("c")
    query = QuoteQuery(request=request, shortlist=shortlist).model_dump(mode="json")
    answer = await composition("service:gateway", "POST", "/internal/quotes", query)
    (offer,) = QuoteAnswer.model_validate_json(answer.content).offers
    assert offer.price.amount > CEILING

    accepted = OfferLimits(
        provider_id="prv_1", price=offer.price, within_s=86_400.0, tariff=dear.tariff
    )
    body = BookMissions(attempt=1, request=request, shortlist=shortlist, offer=accepted)
    booked = await composition(
        "service:gateway",
        "PUT",
        "/internal/deliveries/dlv_1/missions",
        body.model_dump(mode="json"),
    )

    assert booked.json()["outcome"] == "BOOKED"


async def test_a_negative_max_price_is_refused(composition: Any, make: Any) -> None:
    answer = await composition(
        "operator:op", "PUT", "/v1/networks/row", make.network(price_ceiling=-1)
    )

    assert answer.status_code == 422
    assert "price_ceiling" in answer.text
