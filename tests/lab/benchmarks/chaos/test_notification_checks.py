"""The checks of what reached a customer by webhook and by event stream."""

from dataclasses import replace

import pytest
from skyway_lab.benchmarks.chaos.evidence import Evidence, Received
from skyway_lab.benchmarks.chaos.notification_checks import notification_flaws

from tests.lab.benchmarks.chaos.test_judgement import (
    DELIVERED,
    DELIVERY,
    make_event,
    make_events,
    make_good_evidence,
)


def kinds_in(evidence: Evidence) -> list[str]:
    return [kind for kind, _, _ in notification_flaws(evidence)]


def make_notified(*webhooks: Received) -> Evidence:
    return make_good_evidence(webhooks={DELIVERY: webhooks})


def test_an_event_may_arrive_twice() -> None:
    first, second, third, last = make_events(*DELIVERED)

    assert kinds_in(make_notified(first, second, first, third, last, second)) == []


@pytest.mark.parametrize(
    ("order", "flaws"),
    [
        ((0, 2, 1, 3), ["webhook out of order"]),
        ((0, 2, 3), ["webhook with a gap"]),
        ((0, 1, 2), ["webhook incomplete"]),
        ((), ["webhook incomplete"]),
        ((0, 1, 3, 2), ["webhook out of order", "webhook goes on"]),
    ],
)
def test_webhooks_that_are_not_complete_and_in_order_are_flaws(
    order: tuple[int, ...], flaws: list[str]
) -> None:
    events = make_events(*DELIVERED)

    assert kinds_in(make_notified(*(events[place] for place in order))) == flaws


def test_webhooks_that_are_tried_again_later_may_be_missing() -> None:
    evidence = make_notified(*make_events(*DELIVERED)[:2])

    assert kinds_in(replace(evidence, retried=frozenset({DELIVERY}))) == []


def test_an_event_stream_is_checked_too() -> None:
    evidence = make_good_evidence(streams={DELIVERY: make_events(*DELIVERED)[1:]})

    assert kinds_in(evidence) == ["stream with a gap"]


def test_a_second_last_event_is_a_flaw() -> None:
    events = make_events("delivery.requested", "delivery.cancelled", "delivery.completed")

    assert "webhook ended twice" in kinds_in(make_notified(*events))


def test_a_webhook_without_a_valid_signature_is_a_flaw() -> None:
    assert kinds_in(make_notified(*make_events(*DELIVERED, is_signed=False))) == [
        "webhook unsigned"
    ]


def test_a_webhook_that_differs_from_the_stream_is_a_flaw() -> None:
    events = make_events(*DELIVERED)
    events[1] = Received(make_event("delivery.dispatched", 2), at_s=2.0)

    assert kinds_in(make_notified(*events)) == ["webhook differs"]
