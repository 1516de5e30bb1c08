"""Which state may follow which."""

import itertools
from typing import get_args

from skyway_gateway.deliveries.lifecycle.delivery import TERMINAL_STATES, DeliveryState, may_follow

STATES = get_args(DeliveryState)


def test_terminal_states_are_final() -> None:
    for before, after in itertools.product(TERMINAL_STATES, STATES):
        assert may_follow(after, before) == (after == before)


def test_rejected_follows_only_requested() -> None:
    assert [one for one in STATES if may_follow("REJECTED", one)] == ["REQUESTED", "REJECTED"]


def test_cancelled_and_failed_follow_any_state_that_is_not_terminal() -> None:
    for before in set(STATES) - TERMINAL_STATES:
        assert may_follow("CANCELLED", before)
        assert may_follow("FAILED", before)


def test_only_a_delivery_that_has_not_begun_returns_to_requested() -> None:
    back = [one for one in STATES if may_follow("REQUESTED", one)]
    assert back == ["SCHEDULED", "REQUESTED", "PLANNED", "DISPATCHED"]


def test_a_scheduled_delivery_is_requested_before_it_is_planned_or_rejected() -> None:
    after = {one for one in STATES if may_follow(one, "SCHEDULED")}
    assert after == {"SCHEDULED", "REQUESTED", "CANCELLED", "FAILED"}
