"""Each delivery event has one line for people."""

from typing import Any

import pytest

from skyway.cli.event_text import event_text
from skyway.contracts.delivery_event import DeliveryEventType
from skyway.contracts.delivery_event_examples import delivery_event_examples

EVENTS: dict[str, Any] = {
    each.type: each.model_dump(mode="json") for each in delivery_event_examples()
}


@pytest.mark.parametrize("event", EVENTS.values(), ids=EVENTS)
def test_every_event_is_one_line_without_json(event: dict[str, Any]) -> None:
    line = event_text(event)

    assert "\n" not in line
    assert not {"{", "[", "None"} & set(line.split())


def test_an_event_of_another_version_shows_its_json() -> None:
    event = EVENTS["delivery.planned"] | {"data": {"new": 1}}

    assert event_text(event).endswith('delivery.planned  {"new": 1}')


def test_a_shared_trip_is_loaded_with_its_lower_price() -> None:
    alone = EVENTS["delivery.loaded"]
    price = {"amount": 840, "currency": "USD"}
    shared = alone | {"data": alone["data"] | {"is_pooled": True, "price": price}}

    assert event_text(shared) == f"{event_text(alone)}, a shared trip for 8.40 USD"


def test_there_is_an_example_of_every_type() -> None:
    assert set(EVENTS) == set(DeliveryEventType)


@pytest.mark.parametrize(
    ("event_type", "text"),
    [
        ("delivery.requested", "requested: p1 to mcqueeney, p2 to mcqueeney"),
        (
            "delivery.planned",
            "planned: pickup at san-marcos, p1 at 08:29:00, p2 at 08:29:00, 13.40 USD",
        ),
        ("package.delivered", "p1 delivered at mcqueeney"),
        ("delivery.completed", "COMPLETED, 6 min later than planned"),
        ("delivery.cancelled", "CANCELLED (the book is out of print)"),
        (
            "delivery.replanned",
            "planned again (the battery is below the plan by 0.06): p1 at 08:35:00",
        ),
    ],
)
def test_a_line_says_what_has_happened(event_type: str, text: str) -> None:
    assert event_text(EVENTS[event_type]).partition("  ")[2] == text
