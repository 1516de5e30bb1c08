"""Judges a run from outside: what drones did against what customers were notified of."""

from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from skyway_lab.benchmarks.chaos.evidence import CustodyStep, Evidence, Received
from skyway_lab.benchmarks.chaos.notification_checks import notification_flaws
from skyway_lab.benchmarks.load.follow import LAST_EVENTS

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.ids import DeliveryId, PackageId, StationId

#: States of a delivery that stay.
TERMINAL: Final = frozenset({"COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED"})

Package = tuple[DeliveryId, PackageId]


@dataclass(frozen=True, slots=True)
class Flaw:
    """Something that must not be; `kind` is stable, `seen` says what was seen."""

    kind: str
    delivery_id: DeliveryId | None
    seen: str

    def as_text(self) -> str:
        """One line."""
        return f"{self.kind}: {self.delivery_id or 'the system'}: {self.seen}"


def flaws_in(evidence: Evidence) -> list[Flaw]:
    """All flaws; none is what a run must show."""
    found = [
        *_lost(evidence),
        *_needless_questions(evidence),
        *_not_requested(evidence),
        *_handled_twice(evidence),
        *_reported_otherwise(evidence),
        *_wrong_ends(evidence),
    ]
    found += [
        Flaw(kind, delivery_id, seen) for kind, delivery_id, seen in notification_flaws(evidence)
    ]
    return sorted(found, key=lambda flaw: (flaw.delivery_id or "", flaw.kind))


def _lost(evidence: Evidence) -> Iterator[Flaw]:
    """Accepted requests must be known, and end in one terminal state or wait for an operator."""
    for delivery_id in evidence.accepted:
        answer = evidence.answers.get(delivery_id)
        if answer is None or answer.state is None:
            yield Flaw("lost", delivery_id, "the gateway does not know the accepted request")
        elif answer.state not in TERMINAL and delivery_id not in evidence.awaited:
            yield Flaw("not ended", delivery_id, f"it is {answer.state} after the quiet time")


def _needless_questions(evidence: Evidence) -> Iterator[Flaw]:
    """Every drone is back in the end and knows what it did, unless its journal was lost."""
    for delivery_id, awaited in evidence.awaited.items():
        if awaited.drone_id not in evidence.forgetful:
            seen = f"an operator is asked, and {awaited.drone_id} knows: {awaited.question}"
            yield Flaw("needless question", delivery_id, seen)


def _not_requested(evidence: Evidence) -> Iterator[Flaw]:
    flown = {step.delivery_id for step in evidence.journals if step.delivery_id is not None}
    for delivery_id in sorted((flown | evidence.webhooks.keys()) - evidence.accepted.keys()):
        yield Flaw("not requested", delivery_id, "no answered POST made this delivery")


def _handled_twice(evidence: Evidence) -> Iterator[Flaw]:
    """A package is loaded once and handed over once, whichever drone does it."""
    done: dict[tuple[str, DeliveryId, PackageId], list[CustodyStep]] = defaultdict(list)
    for step in evidence.journals:
        if step.is_certain and step.delivery_id is not None:
            for package_id in step.package_ids:
                done[step.kind, step.delivery_id, package_id].append(step)
    for (kind, delivery_id, package_id), steps in done.items():
        if len(steps) > 1:
            where = ", ".join(
                f"{step.drone_id} in {step.mission_id} at {step.station_id}" for step in steps
            )
            names = {"PICK_UP": "loaded twice", "DELIVER": "delivered twice"}
            yield Flaw(names.get(kind, "returned twice"), delivery_id, f"{package_id}: {where}")


def _reported_otherwise(evidence: Evidence) -> Iterator[Flaw]:
    """The customer learns of a hand-over exactly where a journal has it, at the same station."""
    flown = _hand_overs(evidence)
    reported = _reported_hand_overs(evidence)
    for delivery_id, package_id in sorted(flown.keys() | reported.keys()):
        package = (delivery_id, package_id)
        if delivery_id not in evidence.accepted:
            continue
        requested = evidence.accepted[delivery_id].destinations.get(package_id)
        if package not in reported:
            seen = (
                f"{package_id} was handed over at {flown[package]}, the customer was not notified"
            )
            if delivery_id not in evidence.awaited:
                yield Flaw("delivery not reported", delivery_id, seen)
            continue
        if package not in flown:
            seen = f"{package_id} was reported at {reported[package]}, no journal has a hand-over"
            yield Flaw("delivery not flown", delivery_id, seen)
        elif not flown[package] == reported[package] == requested:
            seen = (
                f"{package_id} was requested at {requested}, handed over at {flown[package]}, "
                f"reported at {reported[package]}"
            )
            yield Flaw("wrong station", delivery_id, seen)


def _hand_overs(evidence: Evidence) -> dict[Package, StationId | None]:
    return {
        (step.delivery_id, package_id): step.station_id
        for step in evidence.journals
        if step.kind == "DELIVER" and step.is_certain and step.delivery_id is not None
        for package_id in step.package_ids
    }


def _reported_hand_overs(evidence: Evidence) -> dict[Package, StationId]:
    """Hand-overs by what reached customers on either way."""
    return {
        (delivery_id, PackageId(one.event.data["package_id"])): StationId(
            one.event.data["station_id"]
        )
        for received in (evidence.webhooks, evidence.streams)
        for delivery_id, events in received.items()
        for one in events
        if one.event.type == DeliveryEventType.PACKAGE_DELIVERED
    }


def _wrong_ends(evidence: Evidence) -> Iterator[Flaw]:
    """A delivery's final state fits what drones did: all, some or none of it delivered."""
    flown = Counter(delivery_id for delivery_id, _ in _hand_overs(evidence))
    for delivery_id, requested in evidence.accepted.items():
        answer = evidence.answers.get(delivery_id)
        if answer is None or answer.state not in TERMINAL:
            continue
        count, of = flown[delivery_id], len(requested.destinations)
        fitting = (
            {"COMPLETED"}
            if count == of
            else {"PARTIALLY_COMPLETED"}
            if count
            else TERMINAL - {"COMPLETED", "PARTIALLY_COMPLETED"}
        )
        if answer.state not in fitting:
            seen = f"it is {answer.state}, and drones delivered {count} of {of} packages"
            yield Flaw("wrong end", delivery_id, seen)
        yield from _different_end(delivery_id, answer.state, evidence)


def _different_end(delivery_id: DeliveryId, state: str, evidence: Evidence) -> Iterator[Flaw]:
    """The last event that the customer received names the state that the gateway shows."""
    events: tuple[Received, ...] = tuple(evidence.streams.get(delivery_id, ()))
    last = next((one.event.type for one in events if one.event.type in LAST_EVENTS), None)
    if last is not None and last.removeprefix("delivery.").upper() != state:
        yield Flaw("different end", delivery_id, f"it is {state}, and the customer received {last}")
