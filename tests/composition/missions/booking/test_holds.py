"""Offers that are held: nobody else gets their drones and pads until the hold expires."""

import asyncio
from datetime import timedelta
from typing import Any

import pytest

from skyway.contracts.mission import Booking, BookMissions, OfferHold, OfferLimits
from skyway.contracts.quote import (
    HoldTerms,
    KeepOffer,
    KeptOffer,
    OfferTerms,
    QuoteAnswer,
    QuoteQuery,
)
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import Tariff

GATEWAY = "service:gateway"
LIFE_S = 120.0


async def call(composition: Any, method: str, path: str, body: Any) -> Any:
    return await composition(GATEWAY, method, path, body.model_dump(mode="json"))


async def quote(composition: Any, make: Any, *candidates: Any, **terms: Any) -> QuoteAnswer:
    answer = await ask_for_quote(composition, make, *candidates, **terms)
    assert answer.status_code == 200, answer.text
    return QuoteAnswer.model_validate_json(answer.content)


async def ask_for_quote(
    composition: Any,
    make: Any,
    *candidates: Any,
    hold_id: str = "hld_1",
    customer: str = "ann",
    most: int = 3,
    destination: str = "c",
) -> Any:
    query = QuoteQuery(
        request=make.request(destination),
        shortlist=Shortlist.of(candidates or [make.candidate()]),
        hold=HoldTerms(hold_id=hold_id, customer_id=customer, life_s=LIFE_S, most=most),
    )
    return await call(composition, "POST", "/internal/quotes", query)


def limits(terms: OfferTerms, hold: OfferHold | None) -> OfferLimits:
    same = {"provider_id": terms.provider_id, "price": terms.price}
    return OfferLimits(**same, within_s=terms.delivery_time_s, hold=hold, tariff=Tariff())


def held(terms: OfferTerms, hold_id: str = "hld_1", number: int = 0) -> OfferLimits:
    return limits(terms, OfferHold(hold_id=hold_id, number=number))


async def keep(
    composition: Any, make: Any, offer: OfferLimits, *candidates: Any, destination: str = "c"
) -> KeptOffer:
    asked = KeepOffer(
        hold_id="hld_new",
        customer_id="ann",
        request=make.request(destination),
        shortlist=Shortlist.of(candidates or [make.candidate()]),
        offer=offer,
    )
    answer = await call(composition, "POST", "/internal/offers", asked)
    assert answer.status_code == 200, answer.text
    return KeptOffer.model_validate_json(answer.content)


async def book(
    composition: Any,
    make: Any,
    offer: OfferLimits | None,
    *candidates: Any,
    delivery_id: str = "dlv_1",
    destination: str = "c",
    attempt: int = 1,
) -> Booking:
    body = BookMissions(
        attempt=attempt,
        request=make.request(destination),
        shortlist=Shortlist.of(candidates or [make.candidate()]),
        offer=offer,
    )
    answer = await call(composition, "PUT", f"/internal/deliveries/{delivery_id}/missions", body)
    assert answer.status_code == 200, answer.text
    return Booking.model_validate_json(answer.content)


def codes(answer: Any) -> list[str]:
    return [reason.code for reason in answer.reasons]


async def held_rows(composition: Any) -> list[Any]:
    found = await composition.rows(
        "SELECT hold_id FROM offer_holds UNION ALL "
        "SELECT hold_id FROM pad_reservations WHERE hold_id IS NOT NULL UNION ALL "
        "SELECT held_by FROM drone_links WHERE held_by IS NOT NULL"
    )
    return list(found)


async def test_a_held_drone_is_given_to_no_other_booking(composition: Any, make: Any) -> None:
    answer = await quote(composition, make)

    booking = await composition.book()

    assert [offer.is_held for offer in answer.offers] == [True]
    assert answer.held_until_at == composition.clock.wall_now() + timedelta(seconds=LIFE_S)
    assert booking.outcome == "BUSY"
    assert codes(booking) == ["BUSY"]
    assert await composition.broken() == []


async def test_another_request_gets_another_drone_while_one_is_held(
    composition: Any, make: Any
) -> None:
    await quote(composition, make, make.candidate(1))

    booking = await composition.book(make.candidate(1), make.candidate(2))

    assert [mission.drone_id for mission in booking.missions] == ["drn_2"]


async def test_a_held_offer_is_booked_at_the_offered_times(composition: Any, make: Any) -> None:
    (offer,) = (await quote(composition, make)).offers
    composition.clock.advance(timedelta(seconds=LIFE_S - 1))
    accepted = held(offer)

    kept = await keep(composition, make, accepted)
    booking = await book(composition, make, accepted)

    assert kept.hold == accepted.hold
    assert booking.outcome == "BOOKED"
    (mission,) = booking.missions
    assert mission.state == "BOOKED"
    assert mission.packages == offer.packages
    assert mission.price == offer.price
    assert await held_rows(composition) == []
    assert await composition.broken() == []


async def test_a_held_offer_begins_when_its_hold_has_expired(composition: Any, make: Any) -> None:
    (offer,) = (await quote(composition, make)).offers

    await keep(composition, make, held(offer))
    (mission,) = (await book(composition, make, held(offer))).missions

    assert mission.start_at > composition.clock.now() + timedelta(seconds=LIFE_S)


async def test_the_hold_of_a_quote_covers_its_best_three_offers(
    composition: Any, make: Any
) -> None:
    drones = [make.candidate(number, provider_id=f"prv_{number}") for number in range(1, 5)]

    answer = await quote(composition, make, *drones)

    assert [offer.is_held for offer in answer.offers] == [True, True, True, False]
    booking = await composition.book(*drones)
    assert booking.missions[0].drone_id == answer.offers[3].drone_id


async def test_the_other_held_offers_are_free_once_one_is_booked(
    composition: Any, make: Any
) -> None:
    drones = [make.candidate(number, provider_id=f"prv_{number}") for number in (1, 2)]
    _, second = (await quote(composition, make, *drones)).offers
    accepted = held(second, number=1)

    await keep(composition, make, accepted, *drones)
    booking = await book(composition, make, accepted, *drones)

    assert booking.missions[0].drone_id == second.drone_id
    other = await composition.book(*drones, delivery_id="dlv_2")
    assert other.outcome == "BOOKED"
    assert other.missions[0].state == "BOOKED"


@pytest.mark.parametrize("rate", [1.0, 600.0])
async def test_an_expired_hold_blocks_nothing_even_before_it_is_deleted(
    composition: Any, make: Any, rate: float
) -> None:
    composition.clock.rate = rate
    await quote(composition, make)
    composition.clock.advance(timedelta(seconds=(LIFE_S + 6) * rate))

    booking = await composition.book()

    assert booking.outcome == "BOOKED"
    assert await composition.broken() == []


@pytest.mark.parametrize("rate", [1.0, 600.0])
async def test_a_hold_lasts_as_long_in_wall_time_at_every_clock_rate(
    composition: Any, make: Any, rate: float
) -> None:
    composition.clock.rate = rate
    await quote(composition, make)

    composition.clock.advance(timedelta(seconds=(LIFE_S - 1) * rate))

    assert (await composition.book()).outcome == "BUSY"


async def test_expired_pads_are_free_for_a_plan_that_needs_them(
    composition: Any, make: Any
) -> None:
    await composition.publish(make.network(pads={"b": 1, "d": 1}))
    late = timedelta(seconds=LIFE_S + 6)
    await quote(composition, make, destination="e")
    composition.clock.advance(late)

    booking = await composition.book(make.candidate(2), request=make.request("e"))

    assert [mission.plan.waiting_s for mission in booking.missions] == [0.0]


async def test_expired_holds_are_deleted(composition: Any, make: Any) -> None:
    await quote(composition, make)
    keeper = composition.parts.keeper
    await keeper.delete_expired()
    assert await held_rows(composition) != []

    composition.clock.advance(timedelta(seconds=LIFE_S + 6))
    await keeper.delete_expired()

    assert await held_rows(composition) == []


async def test_two_simultaneous_quotes_do_not_hold_one_drone(composition: Any, make: Any) -> None:
    answers = await asyncio.gather(
        *(
            quote(composition, make, hold_id=f"hld_{number}", customer=f"c{number}")
            for number in range(4)
        )
    )

    holding = [each for each in answers if each.held_until_at is not None]
    assert len(holding) == 1
    assert await composition.broken() == []


async def test_a_customer_holds_at_most_as_many_quotes_as_the_limit(
    composition: Any, make: Any
) -> None:
    drones = [make.candidate(number) for number in range(1, 4)]
    for number, drone in enumerate(drones[:2]):
        await quote(composition, make, drone, hold_id=f"hld_{number}", most=2)

    refused = await ask_for_quote(composition, make, drones[2], hold_id="hld_3", most=2)
    other = await quote(composition, make, drones[2], hold_id="hld_4", customer="bob", most=2)

    problem = refused.json()
    assert (refused.status_code, problem["code"]) == (409, "TOO_MANY_HOLDS")
    assert "2 quotes are held and the limit is 2" in problem["detail"]
    expires_at = composition.clock.wall_now() + timedelta(seconds=LIFE_S)
    assert f"{expires_at:%Y-%m-%dT%H:%M:%SZ}" in problem["detail"]
    assert other.offers[0].is_held


async def test_calls_at_the_same_time_do_not_pass_the_limit(composition: Any, make: Any) -> None:
    answers = await asyncio.gather(
        *(
            ask_for_quote(
                composition, make, make.candidate(number), hold_id=f"hld_{number}", most=2
            )
            for number in range(1, 6)
        )
    )

    rows = await composition.rows("SELECT slot FROM offer_holds ORDER BY slot")
    assert len(rows) <= 2
    refused = [each for each in answers if each.status_code == 409]
    held_quotes = [
        each for each in answers if each.status_code == 200 and each.json()["held_until_at"]
    ]
    assert len(held_quotes) == len(rows)
    assert refused


async def test_an_expired_hold_does_not_count_against_the_limit(
    composition: Any, make: Any
) -> None:
    await quote(composition, make, most=1)
    composition.clock.advance(timedelta(seconds=LIFE_S + 6))

    answer = await quote(composition, make, hold_id="hld_2", most=1)

    assert answer.offers[0].is_held


async def test_an_offer_without_a_hold_is_held_when_it_is_accepted(
    composition: Any, make: Any
) -> None:
    (offer,) = (await quote(composition, make, hold_id="hld_quote")).offers
    await composition.parts.keeper.release("hld_quote")

    first = await keep(composition, make, limits(offer, None))
    kept = await keep(composition, make, limits(offer, None))
    other = await composition.book(delivery_id="dlv_other")
    booking = await book(composition, make, limits(offer, kept.hold))

    # The gateway may have died between the two calls.
    assert first == kept
    assert kept.hold == OfferHold(hold_id="hld_new", number=0)
    assert other.outcome == "BUSY"
    assert booking.outcome == "BOOKED"
    assert await held_rows(composition) == []


async def test_an_offer_whose_drone_was_booked_by_others_is_refused_when_accepted(
    composition: Any, make: Any
) -> None:
    (offer,) = (await quote(composition, make, hold_id="hld_quote")).offers
    await composition.parts.keeper.release("hld_quote")
    await composition.book(request=make.request("e"))

    kept = await keep(composition, make, limits(offer, None))

    assert kept.hold is None
    assert codes(kept) == ["OFFER_LOST"]


async def test_an_offer_of_a_drone_that_is_no_candidate_is_refused(
    composition: Any, make: Any
) -> None:
    (offer,) = (await quote(composition, make)).offers

    kept = await keep(
        composition, make, held(offer), make.candidate(9, provider_id="prv_9", station_id="e")
    )

    assert kept.hold is None
    (reason,) = kept.reasons
    assert reason.code == "OFFER_LOST"
    assert reason.data["hold_loss"] == "DRONE_NOT_FREE"


async def test_a_closure_on_the_way_refuses_a_held_offer_with_the_reason(
    composition: Any, make: Any
) -> None:
    (offer,) = (await quote(composition, make)).offers
    closed = await composition(
        "operator:op", "POST", "/v1/stations/c/closures", {"reason": "roof works"}
    )
    assert closed.is_success, closed.text

    kept = await keep(composition, make, held(offer))

    assert kept.hold is None
    (reason,) = kept.reasons
    assert reason.data["hold_loss"] == "NETWORK_CHANGED"


async def test_a_closure_elsewhere_lets_a_held_offer_be_planned_again(
    composition: Any, make: Any
) -> None:
    (offer,) = (await quote(composition, make)).offers
    await composition("operator:op", "POST", "/v1/stations/e/closures", {"reason": "roof works"})

    kept = await keep(composition, make, held(offer))
    booking = await book(composition, make, limits(offer, kept.hold))

    assert kept.hold == OfferHold(hold_id="hld_1", number=0)
    assert booking.outcome == "BOOKED"
    assert await held_rows(composition) == []


async def test_a_closure_after_acceptance_is_the_cause_of_a_lost_offer(
    composition: Any, make: Any
) -> None:
    (offer,) = (await quote(composition, make)).offers
    await keep(composition, make, held(offer))
    await composition("operator:op", "POST", "/v1/stations/c/closures", {"reason": "roof works"})

    booking = await book(composition, make, held(offer))

    assert booking.outcome == "INFEASIBLE"
    (reason,) = booking.reasons
    assert (reason.code, reason.data["hold_loss"]) == ("OFFER_LOST", "NETWORK_CHANGED")


async def test_an_offer_that_was_accepted_long_ago_is_planned_again_when_its_hold_has_expired(
    composition: Any, make: Any
) -> None:
    (offer,) = (await quote(composition, make)).offers
    await keep(composition, make, held(offer))
    composition.clock.advance(timedelta(hours=1))

    booking = await book(composition, make, held(offer))

    assert booking.outcome == "BOOKED"
    assert await composition.broken() == []


async def test_two_gateways_book_one_held_offer_once(composition: Any, make: Any) -> None:
    (offer,) = (await quote(composition, make)).offers
    await keep(composition, make, held(offer))

    bookings = await asyncio.gather(*(book(composition, make, held(offer)) for _ in range(4)))

    missions = {mission.mission_id for each in bookings for mission in each.missions}
    assert {each.outcome for each in bookings} == {"BOOKED"}
    assert len(missions) == 1
    assert await composition.broken() == []


async def test_a_drone_on_a_mission_is_held_behind_it(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    await begin.accepted(composition, drone, make)
    (offer,) = (await quote(composition, make, hold_id="hld_2")).offers

    other = await composition.book(delivery_id="dlv_other")
    accepted = held(offer, "hld_2")
    kept = await keep(composition, make, accepted)
    booking = await book(composition, make, accepted, delivery_id="dlv_2")

    assert offer.is_held
    assert other.outcome == "BUSY"
    assert kept.hold == accepted.hold
    (mission,) = booking.missions
    assert mission.state == "QUEUED"
    assert mission.packages == offer.packages
    assert await composition.broken() == []


async def test_a_released_hold_frees_its_drone(composition: Any, make: Any) -> None:
    await quote(composition, make)

    answer = await composition(GATEWAY, "DELETE", "/internal/holds/hld_1")
    again = await composition(GATEWAY, "DELETE", "/internal/holds/hld_1")

    assert (answer.status_code, again.status_code) == (204, 204)
    assert (await composition.book()).outcome == "BOOKED"


async def test_a_held_pad_is_shown_without_a_mission(composition: Any, make: Any) -> None:
    await quote(composition, make, destination="e")

    answer = await composition("operator:op", "GET", "/v1/stations/b/reservations")

    assert {item["mission_id"] for item in answer.json()["items"]} == {None}
