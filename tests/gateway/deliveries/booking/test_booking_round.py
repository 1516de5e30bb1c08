"""Which reasons make a delivery infeasible, and which only for now."""

from collections.abc import Callable
from typing import Any

import pytest
from skyway_gateway.deliveries.booking.booking_round import (
    RoundPace,
    drones_that_refused,
    has_too_many_refusals,
    why_infeasible,
)
from skyway_gateway.deliveries.lifecycle.delivery_parts import Refusal

from skyway.contracts.mission import Booking, OfferLimits
from skyway.contracts.shortlist import Candidates, Shortlist
from skyway.delivery.offer import Price, Tariff
from skyway.ids import DroneId, ProviderId
from tests.gateway.deliveries.booking.slow_pace import Seconds, slow_pace

TEMPORARY, LASTING = True, False


@pytest.mark.parametrize(
    ("outcome", "has_candidates", "given", "is_infeasible"),
    [
        ("INFEASIBLE", True, [LASTING], True),
        ("INFEASIBLE", True, [LASTING, TEMPORARY], False),
        ("BUSY", True, [LASTING], False),
        ("BUSY", True, [], False),
        ("BUSY", False, [LASTING], True),
        ("BUSY", False, [TEMPORARY], False),
        ("BUSY", False, [LASTING, TEMPORARY], False),
        ("BUSY", False, [], False),
        ("INFEASIBLE", False, [], False),
    ],
)
def test_only_lasting_reasons_make_a_delivery_infeasible(
    reason: Callable[..., Any],
    candidate: Callable[..., Any],
    outcome: Any,
    has_candidates: bool,
    given: list[bool],
    is_infeasible: bool,
) -> None:
    reasons = tuple(reason("OVERWEIGHT", is_temporary=is_temporary) for is_temporary in given)
    shortlist = Shortlist.of([candidate()] if has_candidates else [])
    found = Candidates(shortlist=shortlist, infeasible=reasons)
    assert (why_infeasible(None, Booking(outcome=outcome), found) is not None) == is_infeasible


@pytest.mark.parametrize(
    ("code", "more_later", "is_infeasible"),
    [
        ("DESTINATION_UNREACHABLE", ("prv_1",), False),
        ("DESTINATION_UNREACHABLE", ("prv_2",), True),
        ("OTHER_CURRENCY", ("prv_1",), True),
    ],
)
def test_a_reason_of_free_drones_may_not_hold_for_busy_ones(
    reason: Callable[..., Any],
    candidate: Callable[..., Any],
    code: str,
    more_later: Any,
    is_infeasible: bool,
) -> None:
    booking = Booking(outcome="INFEASIBLE", reasons=(reason(code, is_temporary=False),))
    shortlist = Shortlist.of([candidate()])

    found = Candidates(shortlist=shortlist, infeasible=(), more_later=more_later)

    assert (why_infeasible(None, booking, found) is not None) == is_infeasible


@pytest.mark.parametrize(
    ("codes", "is_infeasible"),
    [(["NO_DRONES", "NO_DRONES"], False), (["NO_DRONES", "OVERWEIGHT"], True)],
)
def test_a_request_waits_while_no_provider_has_drones_yet(
    reason: Callable[..., Any], codes: list[str], is_infeasible: bool
) -> None:
    reasons = tuple(reason(code, is_temporary=False) for code in codes)
    found = Candidates(shortlist=Shortlist(), infeasible=reasons)

    infeasible = why_infeasible(None, Booking(outcome="BUSY"), found)

    assert (infeasible is not None) == is_infeasible


def test_the_detail_names_provider_code_and_reason(reason: Callable[..., Any]) -> None:
    booking = Booking(outcome="INFEASIBLE", reasons=(reason("OUT_OF_RANGE", is_temporary=False),))
    infeasible = why_infeasible(None, booking, Candidates(shortlist=Shortlist(), infeasible=()))
    assert infeasible is not None
    assert infeasible.detail == "no provider can fly it: prv_1: OUT_OF_RANGE, why OUT_OF_RANGE"


def test_an_offer_does_not_wait_and_its_loss_is_a_reason(reason: Callable[..., Any]) -> None:
    price = Price(amount=700, currency="USD")
    offer = OfferLimits(provider_id="prv_1", price=price, within_s=900, tariff=Tariff())
    booking = Booking(outcome="BUSY", reasons=(reason("BUSY", is_temporary=True),))
    infeasible = why_infeasible(offer, booking, Candidates(shortlist=Shortlist(), infeasible=()))
    assert infeasible is not None
    assert [one.code for one in infeasible.reasons] == ["OFFER_LOST", "BUSY"]
    assert infeasible.reasons[0].data["price"] == {"amount": 700, "currency": "USD"}


def refusal(attempt: int, code: str) -> Refusal:
    return Refusal(
        attempt=attempt,
        provider_id=ProviderId("prv_1"),
        drone_id=DroneId("drn_1"),
        code=code,
        detail="a reason",
    )


@pytest.mark.parametrize(
    ("code", "is_asked_again"),
    [("INSUFFICIENT_ENERGY", False), ("NO_ANSWER", False), ("CALENDAR_CHANGED", True)],
)
def test_only_a_drone_that_has_refused_itself_is_not_asked_again(
    code: str, is_asked_again: bool
) -> None:
    assert drones_that_refused([refusal(1, code)]) == (() if is_asked_again else ("drn_1",))


@pytest.mark.parametrize(("code", "most"), [("NO_ANSWER", 5), ("CALENDAR_CHANGED", 20)])
def test_a_request_is_given_up_after_so_many_refusals(code: str, most: int) -> None:
    refusals = [refusal(number, code) for number in range(1, most + 1)]

    assert not has_too_many_refusals(refusals[:-1])
    assert has_too_many_refusals(refusals)


def test_after_a_pause_all_places_count_as_taken() -> None:
    pace = slow_pace(2.0, most=4)

    assert pace.per_s() == 4 / 2.0


def test_the_pace_is_what_ends_while_rounds_are_under_way() -> None:
    seconds = Seconds()
    pace = RoundPace(16, now_s=seconds)
    for _ in range(10):  # two places are used, and a pause follows each pair
        begun = [pace.begin(), pace.begin()]
        seconds.now_s += 4.0
        for each in begun:
            pace.end(each)
        seconds.now_s += 100.0
    pace.begin()
    seconds.now_s += 3.5

    # 20 rounds ended in 40 busy seconds; the first at 4 s, and 3.5 s have passed since the last.
    assert pace.per_s() == pytest.approx(20 / 39.5)


def test_the_pace_falls_while_nothing_ends() -> None:
    seconds = Seconds()
    pace = RoundPace(4, now_s=seconds)
    begun_s = pace.begin()
    pace.begin()
    seconds.now_s += 1.0
    pace.end(begun_s)
    seconds.now_s += 50.0
    at_50_s = pace.per_s()
    seconds.now_s += 50.0

    assert pace.per_s() == pytest.approx(at_50_s / 2)


def test_a_round_that_asks_nobody_says_nothing_about_the_pace() -> None:
    pace = slow_pace(2.0)
    before = pace.per_s()
    pace.begin()
    pace.end(None)

    assert pace.per_s() == before
