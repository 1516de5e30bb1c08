"""POST /internal/quotes: ranked offers of providers, and why other providers make none."""

from datetime import timedelta
from typing import Any

import pytest

from skyway.contracts.quote import QuoteAnswer, QuoteQuery
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import Tariff
from skyway.drone.models import DJI_MATRICE_300_RTK

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def quote(composition: Any, request: Any, *candidates: Any) -> QuoteAnswer:
    body = QuoteQuery(request=request, shortlist=Shortlist.of(candidates)).model_dump(mode="json")
    answer = await composition("service:gateway", "POST", "/internal/quotes", body)
    assert answer.status_code == 200, answer.text
    return QuoteAnswer.model_validate_json(answer.content)


@pytest.fixture
def drones(make: Any) -> list[Any]:
    """Provider 1 is near and expensive, provider 2 is farther away and cheap."""
    return [
        make.candidate(1, tariff=Tariff(base=900, per_km=10)),
        make.candidate(2, provider_id="prv_2", station_id="b", tariff=Tariff(base=100, per_km=10)),
    ]


@pytest.mark.parametrize(
    ("qos", "order"),
    [
        ({"objective": "FASTEST"}, ["prv_1", "prv_2"]),
        ({"objective": "CHEAPEST"}, ["prv_2", "prv_1"]),
        ({"objective": "GREENEST"}, ["prv_1", "prv_2"]),
        ({"weights": {"time": 0.9, "price": 0.1}}, ["prv_1", "prv_2"]),
        ({"weights": {"time": 0.1, "price": 0.9}}, ["prv_2", "prv_1"]),
    ],
)
async def test_offers_are_ordered_by_the_score_of_the_requested_weights(
    composition: Any, make: Any, drones: Any, qos: Any, order: list[str]
) -> None:
    request = make.request("c", qos=qos)

    answer = await quote(composition, request, *drones)

    weights, offers = request.qos.ranking, answer.offers
    assert [offer.provider_id for offer in offers] == order
    for offer in offers:
        score = (
            weights.time * offer.delivery_time_s / min(each.delivery_time_s for each in offers)
            + weights.price * offer.price.amount / min(each.price.amount for each in offers)
            + weights.energy * offer.energy_j / min(each.energy_j for each in offers)
        )
        assert offer.score == pytest.approx(score)
    assert [offer.score for offer in offers] == sorted(offer.score for offer in offers)


async def test_an_offer_shows_the_margins_that_it_would_be_booked_with(
    composition: Any, make: Any
) -> None:
    await composition.publish(
        make.network(energy_margin=0.2, pad_gap_s=60, tolerated_lateness_s=45)
    )

    answer = await quote(composition, make.request("c"), make.candidate())

    booking = await composition.book()
    assert answer.offers[0].margins == booking.missions[0].margins
    assert answer.offers[0].margins.tolerated_lateness_s == 45


async def test_a_provider_offers_its_drone_with_the_best_plan(composition: Any, make: Any) -> None:
    # Drone 1 is nearer but must charge first, which only its plan shows.
    empty = make.candidate(1, soc=0.15)
    full = make.candidate(2, station_id="b")

    answer = await quote(composition, make.request("c"), empty, full)

    assert [offer.drone_id for offer in answer.offers] == ["drn_2"]


async def test_the_pickup_is_when_the_drone_begins_to_load(composition: Any, make: Any) -> None:
    at_pickup = make.candidate(1)
    one_flight_away = make.candidate(2, provider_id="prv_2", station_id="b")

    answer = await quote(composition, make.request("c"), at_pickup, one_flight_away)

    near, far = sorted(answer.offers, key=lambda offer: offer.provider_id)
    assert far.pickup_at - near.pickup_at > timedelta(minutes=1)


async def test_the_way_of_an_offer_begins_at_the_pickup_and_ends_at_the_last_delivery(
    composition: Any, make: Any
) -> None:
    answer = await quote(composition, make.request("c"), make.candidate(1, station_id="b"))

    assert answer.offers[0].ways == (("a", "b", "c"),)


async def test_a_provider_whose_drones_did_not_come_ranks_lower_and_sees_why(
    composition: Any, make: Any, drone: Any
) -> None:
    absent, honest = make.candidate(1), make.candidate(2, provider_id="prv_2")
    before = await quote(composition, make.request("c"), absent, honest)
    for number in range(3):
        await composition.book(absent, delivery_id=f"dlv_{number}")
        composition.clock.advance(timedelta(seconds=61))
        await composition.receive(drone.state())
        await composition.overdue.step()

    after = await quote(composition, make.request("c"), absent, honest)

    assert [each.provider_id for each in before.offers] == ["prv_1", "prv_2"]
    assert [(each.provider_id, each.no_shows) for each in after.offers] == [
        ("prv_2", 0),
        ("prv_1", 3),
    ]
    assert after.offers[1].score == pytest.approx(1.1 * after.offers[0].score)
    shown = await composition("provider:prv_1", "GET", "/v1/stats/missions")
    assert shown.json()["no_shows"] == {"prv_1": 3}
    other = await composition("provider:prv_2", "GET", "/v1/stats/missions")
    assert other.json()["no_shows"] == {}


async def test_a_quote_reserves_nothing(composition: Any, make: Any, drones: Any) -> None:
    first = await quote(composition, make.request("c"), *drones)

    assert await quote(composition, make.request("c"), *drones) == first
    assert await composition.reservations() == []


async def test_a_provider_that_cannot_serve_is_named_with_its_numbers(
    composition: Any, make: Any, drones: Any
) -> None:
    request = make.request("c", qos={"max_price": 850, "providers": {"denied": ["prv_9"]}})

    answer = await quote(composition, request, *drones)

    reasons = {str(each.provider_id): each for each in answer.infeasible}
    assert [offer.provider_id for offer in answer.offers] == ["prv_2"]
    assert reasons["prv_1"].code == "TOO_EXPENSIVE"
    assert reasons["prv_1"].data["max_price"] == 850


async def test_a_drone_with_a_mission_offers_a_time_after_it(composition: Any, make: Any) -> None:
    drone = make.candidate()
    (free,) = (await quote(composition, make.request("c"), drone)).offers
    await composition.book(drone, delivery_id="dlv_other")

    (later,) = (await quote(composition, make.request("c"), drone)).offers

    assert later.delivery_time_s > 2 * free.delivery_time_s
    assert later.pickup_at > free.pickup_at


@pytest.mark.parametrize(
    ("members", "mass_kg", "code", "named"),
    [
        ({"soc": 0.01, "model": DJI_MATRICE_300_RTK}, 0.4, "LOW_CHARGE", {"soc"}),
        ({}, 99.0, "OVERWEIGHT", {"mass_kg", "limit_kg"}),
        ({"tariff": Tariff(currency="EUR")}, 0.4, "OTHER_CURRENCY", set()),
        ({"station_id": "nowhere"}, 0.4, "DESTINATION_UNREACHABLE", set()),
    ],
)
async def test_a_pinned_provider_that_cannot_serve_gives_its_reason(
    composition: Any, make: Any, members: Any, mass_kg: float, code: str, named: set[str]
) -> None:
    request = make.request("c", mass_kg=mass_kg, qos={"providers": {"pinned": "prv_1"}})

    answer = await quote(composition, request, make.candidate(**members))

    (reason,) = answer.infeasible
    assert (answer.offers, reason.provider_id, reason.code) == ((), "prv_1", code)
    assert named <= set(reason.data)


async def test_an_impossible_deadline_is_named_with_its_seconds(
    composition: Any, make: Any
) -> None:
    soon = composition.clock.now().replace(minute=59).isoformat()
    request = make.request("e", qos={"deadline_at": soon})

    answer = await quote(composition, request, make.candidate())

    (reason,) = answer.infeasible
    assert reason.code == "TOO_LATE"
    assert reason.data["least_s"] > reason.data["latest_s"] > 0


async def test_without_a_deadline_a_provider_is_never_too_late(composition: Any, make: Any) -> None:
    await composition.publish(make.network(pads={"b": 0, "c": 0, "d": 0}))

    answer = await quote(composition, make.request("e"), make.candidate())

    (reason,) = answer.infeasible
    assert reason.code == "OUT_OF_RANGE"


async def test_a_quote_of_an_empty_system_says_how_to_publish_a_network(
    unpublished: Any, make: Any
) -> None:
    answer = await quote(unpublished, make.request("c"), make.candidate())

    (reason,) = answer.infeasible
    assert reason.detail == "no network is published: skyway network import bundled"


async def test_a_drone_under_a_ground_stop_makes_no_offer(composition: Any, make: Any) -> None:
    stop = await composition(
        "operator:op", "POST", "/v1/ground-stops", {"provider_id": "prv_1", "reason": "storm"}
    )
    assert stop.status_code == 201, stop.text

    answer = await quote(composition, make.request("c"), make.candidate())

    (reason,) = answer.infeasible
    assert (reason.code, reason.is_temporary) == ("GROUND_STOP", True)
    assert "storm" in reason.detail


async def test_a_ground_stop_at_the_pickup_stops_drones_that_come_from_elsewhere(
    composition: Any, make: Any
) -> None:
    ring = [[0.1, -0.1], [0.2, -0.1], [0.2, 0.1], [0.1, 0.1], [0.1, -0.1]]
    area = {"type": "Polygon", "coordinates": [ring]}
    stop = await composition(
        "operator:op", "POST", "/v1/ground-stops", {"area": area, "reason": "x"}
    )
    assert stop.status_code == 201, stop.text

    there = await quote(composition, make.request("c", pickup="b"), make.candidate())
    elsewhere = await quote(composition, make.request("c"), make.candidate())

    assert [reason.code for reason in there.infeasible] == ["GROUND_STOP"]
    assert len(elsewhere.offers) == 1


async def test_a_closed_segment_is_not_planned_through(composition: Any, make: Any) -> None:
    closed = await composition("operator:op", "POST", "/v1/segments/b/c/closures", {})
    assert closed.status_code == 201, closed.text

    answer = await quote(composition, make.request("c"), make.candidate())

    assert answer.offers == ()


async def test_only_services_ask_for_quotes(composition: Any, make: Any) -> None:
    body = QuoteQuery(request=make.request("c"), shortlist=Shortlist()).model_dump(mode="json")

    answer = await composition("customer:c", "POST", "/internal/quotes", body)

    assert answer.status_code == 403
