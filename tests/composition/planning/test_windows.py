"""Windows of a request: trips wait for them, begin late, and name the window that is missed."""

from datetime import datetime, timedelta
from typing import Any

import pytest

from skyway.contracts.quote import QuoteAnswer, QuoteQuery
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.plan import Deliver, PickUp, Wait
from skyway.delivery.request import DeliveryRequest
from skyway.scheduling.trip import NoTrip, Trip
from skyway.units import ms_to_moment
from tests.composition.planning.test_find_trip import trip_of

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


def windowed(request: DeliveryRequest, **limits: datetime) -> DeliveryRequest:
    """The request with this window for its first package."""
    first, *others = request.packages
    return request.model_copy(update={"packages": (first.model_copy(update=limits), *others)})


def moments(trip: Trip) -> dict[str, datetime]:
    """When each PICK_UP and DELIVER begins."""
    start_at = ms_to_moment(trip.start_ms)
    return {
        step.kind: start_at + timedelta(seconds=step.start_s)
        for step in trip.plan.steps
        if isinstance(step, PickUp | Deliver)
    }


async def test_a_hand_over_waits_for_its_window_and_the_drone_sets_out_late(
    composition: Any, make: Any
) -> None:
    opens_at = composition.clock.now() + timedelta(hours=5)
    request = windowed(make.request("b"), not_before_at=opens_at)

    trip = await trip_of(composition, request, make.candidate())

    assert isinstance(trip, Trip)
    assert moments(trip)["DELIVER"] == opens_at
    # It stands at b five minutes before the window opens.
    waits = [step.end_s - step.start_s for step in trip.plan.steps if isinstance(step, Wait)]
    assert waits == [pytest.approx(300, abs=0.01)]


async def test_a_drone_sets_out_before_the_earliest_pickup_when_the_pickup_has_an_end(
    composition: Any, make: Any
) -> None:
    opens_at = composition.clock.now() + timedelta(hours=3)
    request = make.request(
        "c", earliest_pickup_at=opens_at, latest_pickup_at=opens_at + timedelta(minutes=2)
    )

    trip = await trip_of(composition, request, make.candidate(station_id="b"))

    assert isinstance(trip, Trip)
    assert moments(trip)["PICK_UP"] == opens_at
    assert ms_to_moment(trip.start_ms) < opens_at


async def test_a_window_that_cannot_be_met_is_named_with_its_lateness(
    composition: Any, make: Any
) -> None:
    latest_at = composition.clock.now() + timedelta(minutes=5)
    request = windowed(make.request("b"), latest_at=latest_at)

    reason = await trip_of(composition, request, make.candidate())

    assert isinstance(reason, NoTrip)
    assert (reason.code, reason.is_temporary) == ("WINDOW_MISSED", False)
    late_s = float(dict(reason.data)["late_s"])
    assert late_s > 60
    assert reason.detail == (
        f"package 'p1' would miss its latest_at 2026-03-01T12:05:00.000Z at 'b' by {late_s:.0f} s"
    )


async def test_a_window_that_is_shorter_than_the_hand_over_is_missed(
    composition: Any, make: Any
) -> None:
    opens_at = composition.clock.now() + timedelta(hours=1)
    request = windowed(
        make.request("b"), not_before_at=opens_at, latest_at=opens_at + timedelta(seconds=5)
    )

    reason = await trip_of(composition, request, make.candidate())

    assert isinstance(reason, NoTrip)
    assert reason.code == "WINDOW_MISSED"
    assert "the hand-over takes 30 s" in reason.detail


async def test_a_quote_promises_an_arrival_within_the_window(composition: Any, make: Any) -> None:
    opens_at = composition.clock.now() + timedelta(hours=2)
    request = windowed(make.request("b"), not_before_at=opens_at)
    query = QuoteQuery(request=request, shortlist=Shortlist.of([make.candidate()]))

    answer = await composition(
        "service:gateway", "POST", "/internal/quotes", query.model_dump(mode="json")
    )

    (offer,) = QuoteAnswer.model_validate_json(answer.content).offers
    assert offer.packages[0].eta_at == opens_at + timedelta(seconds=30)


async def test_loading_that_is_too_late_is_named(composition: Any, make: Any) -> None:
    request = make.request("b", latest_pickup_at="2026-03-01T12:30:00Z")

    reason = await trip_of(composition, request, make.candidate(station_id="c"))

    assert isinstance(reason, NoTrip)
    assert reason.detail.startswith(
        "loading at 'a' would miss latest_pickup_at 2026-03-01T12:30:00.000Z by "
    )
