"""What the severe failsafes begin: another flight, a landing on the spot, a failed step."""

from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.drone_health import Failsafe, Fault
from skyway.contracts.flight_step import FlyStep, RechargeStep
from skyway_drone_agent.analysis.analysis import Assessment
from skyway_drone_agent.analysis.landings import Landing
from skyway_drone_agent.failsafes.failsafe import is_severer
from skyway_drone_agent.failsafes.faults import in_words
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.journal.logbook import CurrentMission, run_under_way
from skyway_drone_agent.journal.mission_changes import Place, descent, flight_to
from skyway_drone_agent.journal.records import FailsafeBegun
from skyway_drone_agent.link.events import EventWriter
from skyway_drone_agent.vehicle import StepRun, Vehicle

#: How long a drone stands beside its pad before it asks for another plan (fleet time).
PAD_WAIT: Final = timedelta(seconds=120)


class Rescue:
    """Writes down what a failsafe begins; the pilot then does it."""

    def __init__(self, recorder: FlightRecorder, vehicle: Vehicle, events: EventWriter) -> None:
        self._recorder = recorder
        self._vehicle = vehicle
        self._events = events

    def begin(self, fault: Fault, failsafe: Failsafe, assessment: Assessment) -> None:
        """Begin what the failsafe says, unless that has begun or is not needed."""
        logbook = self._recorder.logbook
        run, mission = run_under_way(logbook), logbook.mission
        if run is None or mission is None:
            return
        match run.step, failsafe:
            case FlyStep() as flight, Failsafe.DIVERT | Failsafe.LAND_NOW:
                escape = mission.escape
                if escape is None or is_severer(failsafe, escape.failsafe):
                    landing = _landing_for(fault, failsafe, assessment, mission)
                    other = self._other_flight(run, flight, landing, at=assessment.at)
                    self._turn(run, other, fault=fault, failsafe=failsafe)
            case RechargeStep(), Failsafe.WAIT_THEN_ASK:
                if assessment.at - run.started_at >= PAD_WAIT:
                    self._ask(run, fault, assessment)
            case _:
                pass

    def _turn(self, run: StepRun, other: FlyStep, *, fault: Fault, failsafe: Failsafe) -> None:
        at = other.planned_start_at
        soc = self._vehicle.sample(run, at).soc
        used_j = (run.soc - soc) * self._vehicle.model.battery_j
        self._recorder.note(
            FailsafeBegun(
                fault=fault, failsafe=failsafe, at=at, flight=other, soc=soc, used_j=used_j
            )
        )

    def _other_flight(
        self, run: StepRun, flight: FlyStep, landing: Place | None, *, at: datetime
    ) -> FlyStep:
        """The flight from here that replaces the flight under way."""
        here, model = self._vehicle.sample(run, at).position, self._vehicle.model
        if landing is None:
            return descent(instead_of=flight, here=here, at=at, model=model)
        return flight_to(
            landing, instead_of=flight, here=here, at=at, model=model, load_kg=run.load_kg
        )

    def _ask(self, run: StepRun, fault: Fault, assessment: Assessment) -> None:
        """Fail the step where the drone stands, so that the cloud makes another plan."""
        outcome = self._vehicle.cut(run, assessment.at)
        failed = self._events.event("STEP_FAILED", outcome.ended_at, step=run.step)
        self._events.write(
            failed.model_copy(
                update={
                    "started_at": run.started_at,
                    "soc": outcome.soc,
                    "code": fault.value,
                    "detail": in_words(fault, Failsafe.ASK),
                }
            )
        )


def _landing_for(
    fault: Fault, failsafe: Failsafe, assessment: Assessment, mission: CurrentMission
) -> Place | None:
    """The landing to fly to: with a short battery the one with most charge left, else the nearest.

    None means on the spot, for LAND_NOW only. A diverted drone without a safe landing flies
    straight to the landing of its plan.
    """
    if failsafe is Failsafe.LAND_NOW:
        return None
    safe, in_reach = assessment.safe_landings, assessment.landings_in_reach
    if in_reach and fault is Fault.BATTERY_SHORT:
        return max(in_reach, key=lambda one: (one.soc_at_landing, one.station_id))
    if safe:
        return safe[0]
    planned = next(step for step in mission.steps if isinstance(step, FlyStep) and step.lands)
    return Landing(planned.to_id, planned.to_position)
