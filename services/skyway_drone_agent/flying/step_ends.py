"""What the event of a step's end says."""

from typing import Any

from skyway.contracts.drone_health import Failsafe
from skyway.contracts.flight_step import FlightStep, FlyStep
from skyway_drone_agent.failsafes.alarms import in_words
from skyway_drone_agent.flying.proof import handed_over, proof_of
from skyway_drone_agent.journal.current_mission import Escape
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.step_places import end_of
from skyway_drone_agent.vehicles.vehicle import Outcome, StepRun

#: The members of an event that tell a step's end; Any, for each has a type of its own.
EndFields = dict[str, Any]


def end_of_step(run: StepRun, outcome: Outcome, logbook: Logbook) -> EndFields:
    """The end of the step under way: as asked, failed, or where a failsafe has led the drone."""
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
    """The packages of a hand-over, and its evidence; nothing for other steps."""
    package_ids = handed_over(step)
    if not package_ids:
        return {}
    return {"package_ids": package_ids, "data": proof_of(step, logbook, at=outcome.ended_at)}
