"""What the event of a step's end says, with the evidence of a hand-over."""

from datetime import datetime
from typing import Any

from skyway.contracts.drone_health import Failsafe
from skyway.contracts.flight_step import DeliverStep, FlightStep, FlyStep, PickUpStep, ReturnStep
from skyway.contracts.message import utc_text
from skyway.ids import PackageId
from skyway_drone_agent.failsafes.faults import in_words
from skyway_drone_agent.journal.logbook import Escape, Logbook, end_of
from skyway_drone_agent.vehicle import Outcome, StepRun


def handed_over(step: FlightStep) -> tuple[PackageId, ...]:
    """The packages that are handed over in this step."""
    if isinstance(step, PickUpStep):
        return tuple(package.package_id for package in step.packages)
    if isinstance(step, DeliverStep | ReturnStep):
        return step.package_ids
    return ()


def proof_of(step: FlightStep, logbook: Logbook, *, at: datetime) -> dict[str, object]:
    """Place, moment and weights of a hand-over, as an event's `data`."""
    if isinstance(step, PickUpStep):
        packages, sign = step.packages, 1
    else:
        handed = handed_over(step)
        packages, sign = tuple(one for one in logbook.packages if one.package_id in handed), -1
    mass_kg = {package.package_id: package.mass_kg for package in packages}
    return {
        "place": {"station_id": end_of(step), "position": list(logbook.position)},
        "at": utc_text(at),
        "mass_kg": mass_kg,
        "load_before_kg": logbook.load_kg,
        "load_after_kg": max(0.0, logbook.load_kg + sign * sum(mass_kg.values())),
    }


#: The fields of an event that describe a step's end. Any: each has another type.
EndFields = dict[str, Any]


def end_of_step(run: StepRun, outcome: Outcome, logbook: Logbook) -> EndFields:
    """The end of the step under way: as planned, failed, or where a failsafe led the drone."""
    mission, step = logbook.mission, run.step
    before = mission.flown_before if mission else None
    fields: EndFields = {
        "event": "STEP_FAILED" if outcome.has_failed else "STEP_ENDED",
        "started_at": before.since if before else run.started_at,
        "station_id": end_of(step),
        "position": step.to_position if isinstance(step, FlyStep) else run.position,
        "soc": outcome.soc,
        "energy_j": outcome.energy_j + (before.used_j if before else 0.0),
        "code": outcome.code,
    }
    escape = mission.escape if mission else None
    if escape is not None:
        fields |= _escaped(escape)
    if outcome.elsewhere is not None:
        place = outcome.elsewhere
        fields |= {"station_id": place.station_id, "position": place.position}
    if escape is not None or outcome.has_failed:
        return fields
    return fields | _hand_over(step, outcome, logbook)


def _escaped(escape: Escape) -> EndFields:
    fields: EndFields = {
        "event": "STEP_FAILED",
        "code": escape.fault.value,
        "detail": in_words(escape.fault, escape.failsafe),
    }
    if escape.failsafe is Failsafe.LAND_NOW:
        fields |= {"station_id": None}
    return fields


def _hand_over(step: FlightStep, outcome: Outcome, logbook: Logbook) -> EndFields:
    """The packages of a hand-over and its evidence; empty for other steps."""
    package_ids = handed_over(step)
    if not package_ids:
        return {}
    return {"package_ids": package_ids, "data": proof_of(step, logbook, at=outcome.ended_at)}
