"""Checks what reached a customer: complete, in order, signed, and the same by each way."""

from collections.abc import Iterator, Sequence

from skyway_lab.benchmarks.chaos.evidence import Evidence, Received
from skyway_lab.benchmarks.load.follow import LAST_EVENTS

from skyway.ids import DeliveryId, EventId

#: The kind of a flaw, the delivery, and what was seen.
NotificationFlaw = tuple[str, DeliveryId, str]


def notification_flaws(evidence: Evidence) -> Iterator[NotificationFlaw]:
    """All flaws of webhooks and event streams."""
    for delivery_id in evidence.accepted:
        has_ended = delivery_id not in evidence.awaited
        streamed = evidence.streams.get(delivery_id, ())
        notified = evidence.webhooks.get(delivery_id, ())
        for kind, seen in _sequence_flaws(_first_arrivals(streamed), has_ended=has_ended):
            yield f"stream {kind}", delivery_id, seen
        must_be_whole = has_ended and delivery_id not in evidence.retried
        for kind, seen in _sequence_flaws(_first_arrivals(notified), has_ended=must_be_whole):
            yield f"webhook {kind}", delivery_id, seen
        for seen in _differences(streamed, notified):
            yield "webhook differs", delivery_id, seen
        if any(not one.is_signed for one in notified):
            yield "webhook unsigned", delivery_id, "a webhook has no valid signature"


def _first_arrivals(received: Sequence[Received]) -> list[Received]:
    """Without repeated events: each event may arrive several times."""
    first: dict[EventId, Received] = {}
    for one in received:
        first.setdefault(one.event.event_id, one)
    return list(first.values())


def _sequence_flaws(received: Sequence[Received], *, has_ended: bool) -> Iterator[tuple[str, str]]:
    sequences = [one.event.sequence for one in received]
    if sequences != sorted(sequences):
        yield "out of order", f"the sequence was {sequences}"
    if sorted(sequences) != list(range(1, len(sequences) + 1)):
        yield "with a gap", f"the sequence was {sequences}"
    ends = [one.event.type for one in received if one.event.type in LAST_EVENTS]
    if len(ends) > 1:
        yield "ended twice", f"the last events were {', '.join(ends)}"
    elif ends and received[-1].event.type not in LAST_EVENTS:
        yield "goes on", f"{received[-1].event.type} came after {ends[0]}"
    elif not ends and has_ended:
        last = received[-1].event.type if received else "none"
        yield "incomplete", f"the last event of {len(received)} was {last}"


def _differences(streamed: Sequence[Received], notified: Sequence[Received]) -> Iterator[str]:
    """Events that are not the same by stream and by webhook."""
    by_sequence = {one.event.sequence: one.event for one in streamed}
    for one in _first_arrivals(notified):
        other = by_sequence.get(one.event.sequence)
        if other is not None and other != one.event:
            yield f"event {one.event.sequence} is {one.event.type}, and {other.type} in the stream"
