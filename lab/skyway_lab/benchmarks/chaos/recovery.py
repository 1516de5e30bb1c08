"""How long after each fault requests were accepted, planned and dispatched again."""

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from skyway_lab.benchmarks.chaos.evidence import Received

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.ids import DeliveryId


@dataclass(frozen=True, slots=True)
class Healed:
    """A fault that is over; moments are monotonic seconds."""

    fault: str
    at_s: float
    next_fault_s: float = math.inf


@dataclass(frozen=True, slots=True)
class Recovery:
    """Wall seconds from the healing of a fault; None when it did not happen.

    `was_interrupted`: the next fault came before the system had recovered from this one.
    """

    fault: str
    accepted_s: float | None
    planned_s: float | None
    dispatched_s: float | None
    was_interrupted: bool = False


def recoveries(
    healed: Iterable[Healed],
    accepted: Mapping[DeliveryId, float],
    received: Mapping[DeliveryId, Sequence[Received]],
) -> list[Recovery]:
    """For each fault the first request that was accepted after it, planned, and dispatched.

    Only requests that were accepted after the healing count, so that a plan that was made before
    does not look like one. What came after the next fault does not count.
    """
    planned = _first(received, DeliveryEventType.PLANNED)
    dispatched = _first(received, DeliveryEventType.DISPATCHED)
    found = []
    for each in healed:
        new = {delivery_id for delivery_id, at_s in accepted.items() if at_s >= each.at_s}
        accepted_s, planned_s, dispatched_s = (
            _seconds(each, [one[delivery_id] for delivery_id in new & one.keys()])
            for one in (accepted, planned, dispatched)
        )
        was_interrupted = dispatched_s is None and each.next_fault_s < math.inf
        found.append(Recovery(each.fault, accepted_s, planned_s, dispatched_s, was_interrupted))
    return found


def _seconds(healed: Healed, moments: Sequence[float]) -> float | None:
    """From the healing to the first of these moments, if that came before the next fault."""
    first_s = min(moments, default=math.inf)
    return first_s - healed.at_s if first_s < healed.next_fault_s else None


def _first(
    received: Mapping[DeliveryId, Sequence[Received]], kind: DeliveryEventType
) -> dict[DeliveryId, float]:
    """The first moment of an event of this kind, by delivery."""
    return {
        delivery_id: min(moments)
        for delivery_id, events in received.items()
        if (moments := [one.at_s for one in events if one.event.type == kind])
    }


def by_fault(found: Iterable[Recovery]) -> dict[str, list[Recovery]]:
    """The recoveries of each fault, by its name."""
    groups: dict[str, list[Recovery]] = defaultdict(list)
    for each in found:
        groups[each.fault].append(each)
    return dict(sorted(groups.items()))


def middle_and_worst(found: Iterable[Recovery], number: Callable[[Recovery], float | None]) -> str:
    """The median and the largest of these numbers in words.

    Interrupted recoveries without the number are left out; `never` stands for others without it.
    """
    numbers = sorted(
        math.inf if value is None else value
        for each in found
        if (value := number(each)) is not None or not each.was_interrupted
    )
    if not numbers:
        return "interrupted"
    return f"{_words(numbers[(len(numbers) - 1) // 2])} / {_words(numbers[-1])}"


def _words(number_s: float) -> str:
    return "never" if number_s == math.inf else f"{number_s:.1f}"
