"""Whether a reported step can have happened: by the order of steps, place, time and masses.

A dishonest drone, or a sender that pretends to be the drone, may report deliveries that were not
flown. Custody and money follow only from hand-overs that were possible.
"""

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.drone_report import Ack, Connection, DroneEvent, DroneState
from skyway.contracts.flight_step import DeliverStep, FlyStep, PickUpStep, ReturnStep
from skyway.drone.model import DroneModel
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway_composition.missions.mission.step_store import StepRecord

#: The strongest tailwind in which a reported flight is plausible, metres per second. Our own
#: choice: no delivery drone takes off in a storm of force 10.
_TAILWIND_MPS: Final = 25.0

#: How far a message may be ahead of our clock, fleet and wall seconds. Our own choice.
_AHEAD_S: Final = (30.0, 5.0)

#: The messages of drones that composition reads.
DroneReport = Ack | DroneEvent | DroneState | Connection

#: The steps that change who has a package.
HandOver = PickUpStep | DeliverStep | ReturnStep


def latest_believed(clock: FleetClock) -> datetime:
    """The latest fleet time that a message may name."""
    return clock.now() + fleet_margin(clock, fleet_s=_AHEAD_S[0], wall_s=_AHEAD_S[1])


def is_ahead(message: DroneReport, *, latest_at: datetime) -> bool:
    """Whether a message names a moment after `latest_at`, fleet time."""
    match message:
        case DroneEvent(ended_at=about_at) | DroneState(at=about_at):
            return max(message.sent_at, about_at) > latest_at
        case _:
            return message.sent_at > latest_at


def why_too_early(event: DroneEvent, *, sent_at: datetime) -> str | None:
    """Why this end of any step cannot be true; None if it can.

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
) -> str | None:
    """Why this end of a hand-over cannot be true; None if it can.

    `earlier` are the steps before this one, in order, with the events that ended them. The mission
    was sent, or sent again, at `sent_at`, fleet time.
    """
    return (
        _out_of_order(earlier)
        or _elsewhere(step, event)
        or _too_fast(event, earlier, sent_at, model)
        or _without_evidence(step, event)
    )


def why_not_handed_over(step: DeliverStep | None, event: DroneEvent) -> str | None:
    """Why this hand-over of a mission that is over cannot be true; None if it can.

    The order of its steps is not known: their ends were not recorded after the mission was over.
    """
    if step is None:
        return f"the mission has no step {event.step_id} that delivers"
    others = set(event.package_ids) - set(step.package_ids)
    if others:
        return f"the step does not deliver {', '.join(sorted(others))}"
    return _elsewhere(step, event) or _without_evidence(step, event)


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
    fastest_mps = model.speed_empty_mps + _TAILWIND_MPS
    length_m = sum(
        each.step.length_m
        for each in earlier
        if isinstance(each.step, FlyStep) and _was_flown(each.event, since=sent_at)
    )
    took = event.ended_at - sent_at
    needed = timedelta(seconds=length_m / fastest_mps)
    if took >= needed:
        return None
    return (
        f"{length_m:.0f} m were flown {took.total_seconds():.0f} s after the mission was sent; "
        f"the drone needs at least {needed.total_seconds():.0f} s"
    )


def _was_flown(event: DroneEvent | None, *, since: datetime) -> bool:
    """Whether this event ends a whole flight that was over after `since`."""
    return event is not None and event.code != "CUT" and event.ended_at > since


def _without_evidence(step: HandOver, event: DroneEvent) -> str | None:
    """Whether a package left the drone although the load on board is not known to have fallen."""
    if isinstance(step, PickUpStep):
        return None
    before_kg, after_kg = event.data.get("load_before_kg"), event.data.get("load_after_kg")
    if not isinstance(before_kg, int | float) or not isinstance(after_kg, int | float):
        return "it has no evidence: load_before_kg and load_after_kg are missing"
    if before_kg <= after_kg:
        return f"the load on board did not fall: {before_kg} kg before, {after_kg} kg after"
    return None
