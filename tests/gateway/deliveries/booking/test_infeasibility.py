"""Busy or never."""

from collections.abc import Callable
from typing import Any

import pytest
from skyway_gateway.deliveries.booking.infeasibility import why_infeasible

from skyway.contracts.mission import Booking, OfferLimits
from skyway.contracts.shortlist import Candidates, Shortlist
from skyway.delivery.offer import Price

BUSY, NEVER = True, False


@pytest.mark.parametrize(
    ("outcome", "has_candidates", "told", "is_never"),
    [
        ("INFEASIBLE", True, [NEVER], True),
        ("INFEASIBLE", True, [NEVER, BUSY], False),
        ("BUSY", True, [NEVER], False),
        ("BUSY", True, [], False),
        ("BUSY", False, [NEVER], True),
        ("BUSY", False, [BUSY], False),
        ("BUSY", False, [NEVER, BUSY], False),
        ("BUSY", False, [], False),
        ("INFEASIBLE", False, [], False),
    ],
)
def test_only_lasting_reasons_make_a_delivery_infeasible(
    reason: Callable[..., Any],
    candidate: Callable[..., Any],
    outcome: Any,
    has_candidates: bool,
    told: list[bool],
    is_never: bool,
) -> None:
    reasons = tuple(reason("NO_DRONES", is_temporary=is_temporary) for is_temporary in told)
    shortlist = Shortlist.of([candidate()] if has_candidates else [])
    found = Candidates(shortlist=shortlist, infeasible=reasons)
    assert (why_infeasible(None, Booking(outcome=outcome), found) is not None) == is_never


@pytest.mark.parametrize(
    ("code", "more_later", "is_never"),
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
    is_never: bool,
) -> None:
    booking = Booking(outcome="INFEASIBLE", reasons=(reason(code, is_temporary=False),))
    shortlist = Shortlist.of([candidate()])

    found = Candidates(shortlist=shortlist, infeasible=(), more_later=more_later)

    assert (why_infeasible(None, booking, found) is not None) == is_never


def test_the_detail_names_provider_code_and_reason(reason: Callable[..., Any]) -> None:
    booking = Booking(outcome="INFEASIBLE", reasons=(reason("OUT_OF_RANGE", is_temporary=False),))
    never = why_infeasible(None, booking, Candidates(shortlist=Shortlist(), infeasible=()))
    assert never is not None
    assert never.detail == "no provider can fly it: prv_1: OUT_OF_RANGE, why OUT_OF_RANGE"


def test_an_offer_does_not_wait_and_its_loss_is_a_reason(reason: Callable[..., Any]) -> None:
    price = Price(amount=700, currency="USD")
    offer = OfferLimits(provider_id="prv_1", price=price, within_s=900)
    booking = Booking(outcome="BUSY", reasons=(reason("BUSY", is_temporary=True),))
    never = why_infeasible(offer, booking, Candidates(shortlist=Shortlist(), infeasible=()))
    assert never is not None
    assert [one.code for one in never.reasons] == ["OFFER_LOST", "BUSY"]
    assert never.reasons[0].data["price"] == {"amount": 700, "currency": "USD"}
