"""Whether an offer can be booked as it is held, or must be planned again, and why."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.calendar.store import calendar_versions
from skyway_composition.missions.booking.hold_store import (
    HeldOffer,
    Hold,
    delete_expired,
    extend_hold,
    find_hold,
    held_offer,
    hold_loss,
)
from skyway_composition.missions.booking.store import SeenCalendars
from skyway_composition.networks.store import Present
from skyway_composition.planning.availability import BookedMission

from skyway.contracts.mission import OfferLimits
from skyway.delivery.offer import Price, Tariff
from skyway.ids import DroneId, HoldId, MissionId, NetworkId, ProviderId
from skyway.units import moment_to_ms
from tests.composition.missions.booking.test_holds import quote

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

PRESENT = Present(NetworkId("row"), 1, 0)


@pytest.fixture
async def hold(composition: Any, make: Any) -> Hold:
    """The hold of a quote with one offer."""
    await quote(composition, make)
    async with composition.db.read() as connection:
        found = await find_hold(connection, HoldId("hld_1"))
    assert found is not None
    return found


@pytest.fixture
def held(hold: Hold) -> HeldOffer:
    return hold.offers[0]


def unchanged(held: HeldOffer) -> SeenCalendars:
    return SeenCalendars((), held.calendars)


@pytest.fixture
def now_ms(composition: Any) -> int:
    return moment_to_ms(composition.clock.now())


def test_an_offer_is_held_until_its_hold_expires(hold: Hold) -> None:
    assert held_offer(hold, 0, now_ms=hold.until_ms - 1) == hold.offers[0]
    assert held_offer(hold, 0, now_ms=hold.until_ms) is None


def test_a_hold_has_no_other_offers_than_its_own(hold: Hold, now_ms: int) -> None:
    assert held_offer(hold, 1, now_ms=now_ms) is None
    assert held_offer(None, 0, now_ms=now_ms) is None


def test_an_unchanged_offer_can_be_booked(held: HeldOffer, make: Any, now_ms: int) -> None:
    loss = hold_loss(
        held, request=make.request("c"), present=PRESENT, now=unchanged(held), now_ms=now_ms
    )

    assert loss is None


def test_an_offer_cannot_be_booked_after_its_planned_start(held: HeldOffer, make: Any) -> None:
    late_ms = held.starts_ms + 1

    loss = hold_loss(
        held, request=make.request("c"), present=PRESENT, now=unchanged(held), now_ms=late_ms
    )

    assert loss == "EXPIRED"


def test_a_closure_changes_the_network_of_an_offer(held: HeldOffer, make: Any, now_ms: int) -> None:
    closed = Present(NetworkId("row"), 1, 1)

    loss = hold_loss(
        held, request=make.request("c"), present=closed, now=unchanged(held), now_ms=now_ms
    )

    assert loss == "NETWORK_CHANGED"


def test_a_cancelled_package_changes_the_request_of_an_offer(
    held: HeldOffer, make: Any, now_ms: int
) -> None:
    request = make.request("c", "c")

    loss = hold_loss(held, request=request, present=PRESENT, now=unchanged(held), now_ms=now_ms)

    assert loss == "REQUEST_CHANGED"


@pytest.mark.parametrize(
    ("mission_id", "code"), [("msn_9", "CALENDAR_CHANGED"), (None, "DRONE_NOT_FREE")]
)
def test_a_mission_that_was_not_there_changes_the_calendar_of_an_offer(
    held: HeldOffer, make: Any, now_ms: int, mission_id: MissionId | None, code: str
) -> None:
    missions = (BookedMission(DroneId("drn_1"), mission_id, start_ms=now_ms),)
    now = SeenCalendars(missions, {DroneId("drn_1"): 1 + held.calendars[DroneId("drn_1")]})

    loss = hold_loss(held, request=make.request("c"), present=PRESENT, now=now, now_ms=now_ms)

    assert loss == code


async def test_an_offer_remembers_the_calendar_behind_which_it_begins(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    await begin.accepted(composition, drone, make)
    await quote(composition, make, hold_id="hld_2")
    async with composition.db.read() as connection:
        found = await find_hold(connection, HoldId("hld_2"))
        versions = await calendar_versions(connection, [DroneId("drn_1")])

    assert found is not None
    assert found.offers[0].calendars == versions
    assert found.offers[0].starts_ms > moment_to_ms(
        composition.clock.now() + timedelta(seconds=120)
    )


async def test_a_hold_that_is_extended_before_it_is_deleted_stays(
    composition: Any, hold: Hold
) -> None:
    """Its offer is being accepted."""
    later_ms = hold.until_ms + 60_000

    class Extending:
        read = composition.db.read

        @asynccontextmanager
        async def write(self) -> AsyncIterator[Any]:
            async with composition.db.write() as tx:
                await extend_hold(tx, hold.hold_id, until_ms=later_ms)
            async with composition.db.write() as tx:
                yield tx

    db: Any = Extending()
    await delete_expired(db, now_ms=hold.until_ms)

    async with composition.db.read() as connection:
        found = await find_hold(connection, hold.hold_id)
    assert found is not None
    assert found.until_ms == later_ms


@pytest.mark.parametrize(
    ("change", "is_kept"),
    [
        ({}, True),
        ({"provider_id": ProviderId("prv_other")}, False),
        ({"price": 1}, False),
        ({"currency": "EUR"}, False),
    ],
)
def test_a_held_offer_keeps_provider_and_price(
    held: HeldOffer, change: dict[str, Any], is_kept: bool
) -> None:
    price = held.offer.price
    amount = price.amount - change.get("price", 0)
    promised = OfferLimits(
        provider_id=change.get("provider_id", held.offer.provider_id),
        price=Price(amount=amount, currency=change.get("currency", price.currency)),
        within_s=60.0,
        tariff=Tariff(),
    )

    assert held.keeps(promised) == is_kept
