"""Whether a reported step can have happened: by the order of steps, place, time and masses.

A dishonest drone, or a sender that pretends to be the drone, may report deliveries that were not
flown. Custody and money follow only from hand-overs that were possible.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.drone_report import Ack, Connection, DroneEvent, DroneState
from skyway.contracts.flight_step import DeliverStep, FlyStep, PickUpStep, ReturnStep
from skyway.drone.model import DroneModel
from skyway.geo import Position, distance_m
from skyway.ids import PackageId, StationId
from skyway_composition.missions.mission.step_store import StepRecord

#: The strongest tailwind with which a drone is believed to fly, metres per second. Our own choice:
#: no drone of a delivery service takes off in a storm of force 10.
TAILWIND_MPS: Final = 25.0

#: By how much the load may fall otherwise than the packages weigh, kilograms and a share: twice
#: what a loader's scale may differ, since the drone weighs before and after. Our own choice.
_MASS_TOLERANCE_KG: Final = 0.1
_MASS_TOLERANCE: Final = 0.1
_MOST_KG: Final = 1e5

#: The messages of drones that composition reads.
DroneReport = Ack | DroneEvent | DroneState | Connection

#: Events of a drone that stands and waits for proofs: nothing has changed hands.
_NO_HAND_OVER: Final = ("HAND_OVER_AWAITED", "PIN_ENTERED")

#: The steps that change who has a package.
HandOver = PickUpStep | DeliverStep | ReturnStep


def is_ahead(message: DroneReport, *, latest_at: datetime) -> bool:
    """Whether a message names a moment after `latest_at`, fleet time."""
    match message:
        case DroneEvent(ended_at=about_at) | DroneState(at=about_at):
            return max(message.sent_at, about_at) > latest_at
        case _:
            return message.sent_at > latest_at


def is_behind(message: DroneReport, *, earliest_at: datetime) -> bool:
    """Whether a state speaks of a moment before `earliest_at`, fleet time.

    All other messages may be old: events and answers wait on board until the drone is connected,
    and a last will is written when it connects.
    """
    return isinstance(message, DroneState) and min(message.sent_at, message.at) < earliest_at


@dataclass(frozen=True, slots=True)
class KnownPlace:
    """Where a drone certainly was: it had a package handed over there, or began there."""

    station_id: StationId
    position: Position
    at: datetime


@dataclass(frozen=True, slots=True)
class Carried:
    """What a drone has on board by the ledger, with the masses in kilograms."""

    masses_kg: Mapping[PackageId, float]

    def of(self, package_ids: Iterable[PackageId]) -> float | None:
        """The mass of those of these packages that are on board; None if none of them is."""
        masses_kg = [self.masses_kg[each] for each in package_ids if each in self.masses_kg]
        return sum(masses_kg) if masses_kg else None


def why_too_early(event: DroneEvent, *, sent_at: datetime) -> str | None:
    """Why this event of a mission cannot be true; None if it can.

    The drone got the mission at `sent_at`, fleet time, or later.
    """
    began_at = event.started_at or event.ended_at
    if began_at >= sent_at and event.ended_at >= began_at:
        return None
    return f"it lasted from {began_at} to {event.ended_at}; the mission was sent at {sent_at}"


def why_impossible(
    step: HandOver,
    event: DroneEvent,
    earlier: Sequence[StepRecord],
    *,
    sent_at: datetime,
    model: DroneModel,
    carried: Carried,
) -> str | None:
    """Why this end of a hand-over, or the wait for its proofs, cannot be true; None if it can.

    `earlier` are the steps before this one, in order, with the events that ended them. The mission
    was sent, or sent again, at `sent_at`, fleet time.
    """
    return (
        _out_of_order(earlier)
        or _elsewhere(step, event)
        or _too_fast(event, earlier, sent_at, model)
        or (None if event.event in _NO_HAND_OVER else _without_evidence(step, event, carried))
    )


def why_not_handed_over(
    step: DeliverStep | None, event: DroneEvent, carried: Carried
) -> str | None:
    """Why this hand-over of a mission that is over cannot be true; None if it can.

    The order of its steps is not known: their ends were not recorded after the mission was over.
    """
    if step is None:
        return f"the mission has no step {event.step_id} that delivers"
    others = set(event.package_ids) - set(step.package_ids)
    if others:
        return f"the step does not deliver {', '.join(sorted(others))}"
    return _elsewhere(step, event) or _without_evidence(step, event, carried)


def why_out_of_reach(
    event: DroneEvent, here: Position | None, places: Iterable[KnownPlace], model: DroneModel
) -> str | None:
    """Why the drone cannot be at its step's station yet; None if it can.

    No drone is faster than the straight line from each place where it was, though its steps say
    so.
    """
    if here is None:
        return None
    for place in places:
        length_m, took = distance_m(place.position, here), event.ended_at - place.at
        needed = shortest_flight(length_m, model)
        if took < needed:
            return (
                f"it was at {place.station_id}, {length_m:.0f} m away, "
                f"{took.total_seconds():.0f} s before; "
                f"the drone needs at least {needed.total_seconds():.0f} s"
            )
    return None


def shortest_flight(length_m: float, model: DroneModel) -> timedelta:
    """How long the drone needs for this length with the strongest tailwind that is believed."""
    return timedelta(seconds=length_m / (model.speed_empty_mps + TAILWIND_MPS))


def _out_of_order(earlier: Sequence[StepRecord]) -> str | None:
    for each in earlier:
        if each.status == "PLANNED":
            return f"step {each.step.step_id} ({each.step.kind}) has not ended before"
    return None


def _elsewhere(step: HandOver, event: DroneEvent) -> str | None:
    if event.station_id == step.station_id:
        return None
    return f"it is reported at {event.station_id or 'no station'}, not at {step.station_id}"


def _too_fast(
    event: DroneEvent, earlier: Sequence[StepRecord], sent_at: datetime, model: DroneModel
) -> str | None:
    """Whether the flights since `sent_at` took less time than with a strong tailwind."""
    length_m = sum(
        each.step.length_m
        for each in earlier
        if isinstance(each.step, FlyStep) and _was_flown(each.event, since=sent_at)
    )
    took, needed = event.ended_at - sent_at, shortest_flight(length_m, model)
    if took >= needed:
        return None
    return (
        f"{length_m:.0f} m were flown {took.total_seconds():.0f} s after the mission was sent; "
        f"the drone needs at least {needed.total_seconds():.0f} s"
    )


def _was_flown(event: DroneEvent | None, *, since: datetime) -> bool:
    """Whether this event ends a whole flight that was over after `since`."""
    return event is not None and event.code != "CUT" and event.ended_at > since


def _without_evidence(step: HandOver, event: DroneEvent, carried: Carried) -> str | None:
    """Whether packages left the drone that it has not, or without their mass leaving it."""
    if isinstance(step, PickUpStep):
        return None
    handed_kg = carried.of(step.package_ids)
    if handed_kg is None:
        return f"it has none of {', '.join(step.package_ids)} on board"
    before_kg, after_kg = _mass_kg(event, "load_before_kg"), _mass_kg(event, "load_after_kg")
    if before_kg is None or after_kg is None:
        return "it has no evidence: load_before_kg and load_after_kg are no masses"
    if before_kg <= after_kg:
        return f"the load on board did not fall: {before_kg} kg before, {after_kg} kg after"
    tolerance_kg = max(_MASS_TOLERANCE_KG, _MASS_TOLERANCE * handed_kg)
    if abs(before_kg - after_kg - handed_kg) > tolerance_kg:
        return (
            f"the load on board fell by {before_kg - after_kg:g} kg, and the packages weigh "
            f"{handed_kg:g} kg"
        )
    return None


def _mass_kg(event: DroneEvent, name: str) -> float | None:
    """A mass in the evidence; None if it is no number from 0 on."""
    value = event.data.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if 0.0 <= value <= _MOST_KG else None
