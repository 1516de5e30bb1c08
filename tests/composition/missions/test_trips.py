"""Several missions for one delivery, booked together on both databases; offers kept or lost."""

import asyncio
from dataclasses import replace
from typing import Any

import pytest

from skyway.contracts.mission import Booking, BookMissions
from skyway.contracts.quote import QuoteQuery
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId
from tests.counting_mint import CountingMint

pytestmark = pytest.mark.databases("sqlite")

#: The drones of these tests lift 15.3 kg: two of these packages are too much for one.
HEAVY_KG = 9.0


class NoSecondInstruction(CountingMint):
    """Fails when it mints the second mission's instruction."""

    def __call__(self, prefix: str) -> str:
        minted = super().__call__(prefix)
        if prefix == "ins" and minted.endswith("2"):
            raise RuntimeError("no second instruction")
        return minted


async def book(composition: Any, *candidates: Any, **members: Any) -> Booking:
    shortlist = Shortlist.of(candidates)
    body = BookMissions.model_validate({"attempt": 1, "shortlist": shortlist, **members})
    path = "/internal/deliveries/dlv_1/missions"
    answer = await composition("service:gateway", "PUT", path, body.model_dump(mode="json"))
    assert answer.status_code == 200, answer.text
    return Booking.model_validate_json(answer.content)


def heavy(make: Any, *destinations: str, **members: Any) -> DeliveryRequest:
    request: DeliveryRequest = make.request(*destinations, mass_kg=HEAVY_KG, **members)
    return request


async def count(composition: Any, table: str) -> int:
    (row,) = await composition.rows(f"SELECT count(*) AS n FROM {table}")
    return int(row.n)


async def publish_short(composition: Any, make: Any, **members: Any) -> None:
    """A row of stations near enough to each other for heavy packages."""
    network = make.network(**members)
    for feature in network["features"]:
        if feature["properties"]["kind"] == "segment":
            feature["properties"]["length_m"] = 4_000
    await composition.publish(network)


async def test_a_load_too_heavy_for_one_drone_is_split_over_two(
    composition: Any, make: Any
) -> None:
    await publish_short(composition, make)
    drones = [make.candidate(number) for number in (1, 2, 3)]

    booking = await book(composition, *drones, request=heavy(make, "b", "c"))

    assert booking.outcome == "BOOKED"
    assert [mission.trip for mission in booking.missions] == [1, 2]
    assert len({mission.drone_id for mission in booking.missions}) == 2
    carried = sorted(eta.package_id for mission in booking.missions for eta in mission.packages)
    assert carried == ["p1", "p2"]
    assert await count(composition, "instructions") == 2
    assert await composition.broken() == []


async def test_the_second_trip_avoids_the_pads_of_the_first_trip(
    composition: Any, make: Any
) -> None:
    await publish_short(composition, make, pads=dict.fromkeys("abcde", 1))
    drones = [make.candidate(number, soc=0.35) for number in (1, 2)]

    booking = await book(composition, *drones, request=heavy(make, "d", "e"))

    assert booking.outcome == "BOOKED"
    holders = {row.mission_id for row in await composition.reservations()}
    assert holders == {mission.mission_id for mission in booking.missions}
    assert len(holders) == 2
    assert await composition.broken() == []


async def test_more_destinations_than_one_trip_can_have_are_split(
    composition: Any, make: Any
) -> None:
    await composition.publish(make.network(max_destinations_per_trip=2))
    drones = [make.candidate(number) for number in (1, 2)]

    booking = await book(composition, *drones, request=make.request("b", "c", "d"))

    assert [len(mission.packages) for mission in booking.missions] == [2, 1]


async def test_two_trips_are_booked_both_or_not_at_all(composition: Any, make: Any) -> None:
    await publish_short(composition, make)
    parts = composition.parts
    failing = replace(parts.bookings, context=replace(parts, mint=NoSecondInstruction()))
    drones = Shortlist.of([make.candidate(1), make.candidate(2)])

    with pytest.raises(RuntimeError):
        await failing.book(
            DeliveryId("dlv_1"),
            BookMissions(attempt=1, request=heavy(make, "b", "c"), shortlist=drones),
        )

    tables = ("missions", "mission_steps", "pad_reservations", "instructions", "custody", "outbox")
    assert {table: await count(composition, table) for table in tables} == dict.fromkeys(tables, 0)


@pytest.mark.databases("postgresql")
async def test_deliveries_that_need_two_drones_never_get_only_one(
    composition: Any, make: Any
) -> None:
    await publish_short(composition, make)
    drones = [make.candidate(number) for number in (1, 2, 3)]
    request = heavy(make, "b", "c", qos={"max_price": 100_000})

    bookings = await asyncio.gather(
        *(
            composition.book(*drones, delivery_id=f"dlv_{number}", request=request)
            for number in range(6)
        )
    )

    booked = [booking for booking in bookings if booking.outcome == "BOOKED"]
    assert {len(booking.missions) for booking in booked} == {2}
    assert await count(composition, "missions") == 2 * len(booked)
    assert await composition.broken() == []


@pytest.mark.databases("sqlite", "postgresql")
async def test_with_too_few_drones_some_packages_are_left_for_later(
    composition: Any, make: Any
) -> None:
    await publish_short(composition, make)

    booking = await book(composition, make.candidate(), request=heavy(make, "b", "c"))

    (mission,) = booking.missions
    assert len(mission.packages) == 1
    rows = await composition.rows("SELECT package_id FROM custody")
    assert [row.package_id for row in rows] == [mission.packages[0].package_id]


async def test_with_a_price_limit_all_trips_are_booked_or_none(composition: Any, make: Any) -> None:
    await publish_short(composition, make)
    request = heavy(make, "b", "c", qos={"max_price": 100_000})

    booking = await book(composition, make.candidate(), request=request)

    (reason,) = booking.reasons
    assert (booking.outcome, reason.code) == ("BUSY", "NOT_ENOUGH_DRONES")
    assert reason.data == {"drones": 1, "packages_left": 1}
    assert await count(composition, "missions") == 0


async def test_the_price_limit_applies_to_all_trips_together(composition: Any, make: Any) -> None:
    await publish_short(composition, make)
    drones = [make.candidate(number) for number in (1, 2)]
    free = await composition.parts.quotes.answer(_query(heavy(make, "b", "c"), drones))
    price = free.offers[0].price.amount

    dear = await book(
        composition, *drones, request=heavy(make, "b", "c", qos={"max_price": price - 1})
    )
    kept = await book(composition, *drones, request=heavy(make, "b", "c", qos={"max_price": price}))

    assert (dear.outcome, dear.reasons[0].code) == ("INFEASIBLE", "TOO_EXPENSIVE")
    assert dear.reasons[0].data == {"price": price, "max_price": price - 1}
    assert kept.outcome == "BOOKED"
    assert sum(mission.price.amount for mission in kept.missions) == price


async def test_an_accepted_offer_is_kept(composition: Any, make: Any) -> None:
    drones = [make.candidate(1), make.candidate(2, provider_id="prv_2")]
    quote = await composition.parts.quotes.answer(_query(make.request("c"), drones))
    accepted = next(offer for offer in quote.offers if offer.provider_id == "prv_2")

    booking = await book(composition, *drones, request=make.request("c"), offer=_limits(accepted))

    (mission,) = booking.missions
    assert mission.provider_id == "prv_2"
    assert mission.price == accepted.price
    assert mission.plan.delivery_time_s == pytest.approx(accepted.delivery_time_s, abs=1)


@pytest.mark.parametrize(
    ("change", "because"),
    [({"price": 1}, "TOO_EXPENSIVE"), ({"within_s": 5.0}, "TOO_LATE")],
)
async def test_an_offer_that_cannot_be_kept_is_lost(
    composition: Any, make: Any, change: dict[str, Any], because: str
) -> None:
    drone = make.candidate()
    quote = await composition.parts.quotes.answer(_query(make.request("c"), [drone]))
    limits = _limits(quote.offers[0], **change)

    booking = await book(composition, drone, request=make.request("c"), offer=limits)

    (reason,) = booking.reasons
    assert (booking.outcome, reason.code) == ("INFEASIBLE", "OFFER_LOST")
    assert reason.is_temporary is False
    assert reason.data["because"] == [because]


async def test_an_offer_whose_drones_are_busy_is_lost(composition: Any, make: Any) -> None:
    drone = make.candidate()
    quote = await composition.parts.quotes.answer(_query(make.request("c"), [drone]))
    await composition.book(drone, delivery_id="dlv_other")

    booking = await book(
        composition, drone, request=make.request("c"), offer=_limits(quote.offers[0])
    )

    assert (booking.outcome, booking.reasons[0].code) == ("INFEASIBLE", "OFFER_LOST")
    # The drone is free only after the time that the offer promised.
    assert booking.reasons[0].data["because"] == ["TOO_LATE"]


async def test_missions_show_the_margins_of_their_plans(composition: Any, make: Any) -> None:
    await composition.publish(make.network(energy_margin=0.2, pad_gap_s=60))

    with_margin = await composition.book()

    (mission,) = with_margin.missions
    assert mission.margins.energy_margin == 0.2
    assert mission.margins.pad_gap_s == 60
    await composition.publish(make.network(energy_margin=0.0, pad_gap_s=60))
    without = await composition.book(make.candidate(2), delivery_id="dlv_2")
    flights = [
        next(step for step in booking.missions[0].plan.steps if step.kind == "FLY")
        for booking in (with_margin, without)
    ]
    assert flights[0].energy_j == pytest.approx(1.2 * flights[1].energy_j)


def _query(request: Any, candidates: Any) -> QuoteQuery:
    return QuoteQuery(request=request, shortlist=Shortlist.of(candidates))


def _limits(offer: Any, *, price: int | None = None, within_s: float | None = None) -> Any:
    amount = offer.price.amount if price is None else price
    return {
        "provider_id": offer.provider_id,
        "price": {"amount": amount, "currency": offer.price.currency},
        "within_s": offer.delivery_time_s if within_s is None else within_s,
        "tariff": {},
    }
