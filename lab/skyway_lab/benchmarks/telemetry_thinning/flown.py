"""A mission flown second by second: what a simulated drone's sensors show, and what is true."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Final

from skyway_drone_agent.journal.logbook import CurrentMission, Logbook, run_under_way
from skyway_drone_agent.journal.record_effects import logbook_after
from skyway_drone_agent.journal.records import Answer, EventRecorded, StepBegun
from skyway_drone_agent.simulated.disturbances import Disturbances
from skyway_drone_agent.simulated.physics import Physics
from skyway_drone_agent.simulated.vehicle import reading_of
from skyway_drone_agent.vehicle import Outcome, Reading, StepRun

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import FlightStep, FlyStep, end_of
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import DeliveryId, DroneId, InstructionId, MissionId, StationId

#: When the missions begin.
START: Final = datetime(2026, 3, 1, 12, tzinfo=UTC)


@dataclass(frozen=True, slots=True)
class Moment:
    """One look: what the drone knows, what its sensors show, and how full the battery really is."""

    logbook: Logbook
    run: StepRun
    reading: Reading
    true_soc: float


@dataclass(frozen=True, slots=True)
class Flown:
    """A mission, the drone that flies it, and what disturbs it."""

    model: DroneModel
    steps: tuple[FlightStep, ...]
    disturbances: Disturbances
    drone_id: DroneId
    soc: float = 1.0
    begins_at: datetime = START

    @property
    def physics(self) -> Physics:
        """What decides how the steps end."""
        return Physics(self.model, self.disturbances, drone_id=self.drone_id)

    def moments(self, *, every_s: float = 1.0) -> Iterator[Moment]:
        """The moments of all steps, each step begun when the one before has ended."""
        physics, now = self.physics, self.begins_at
        logbook = _ready(self.steps, soc=self.soc)
        for step in self.steps:
            begun = StepBegun(
                step_id=step.step_id,
                started_at=max(now, step.planned_start_at),
                released_through=_landing_from(self.steps, step),
            )
            logbook = logbook_after(logbook, begun)
            run = run_under_way(logbook)
            if run is None:
                return
            outcome = physics.outcome_of(run)
            now = run.started_at
            while now < outcome.ended_at:
                sample = physics.sample(run, now)
                yield Moment(logbook, run, reading_of(physics, run, now), sample.soc)
                now += timedelta(seconds=every_s)
            now = outcome.ended_at
            logbook = logbook_after(logbook, EventRecorded(event=_ended(run, outcome)))


def _ready(steps: Sequence[FlightStep], *, soc: float) -> Logbook:
    """A drone at the mission's first station that has accepted it."""
    first_flight = next(step for step in steps if isinstance(step, FlyStep))
    answer = Answer(instruction_id=InstructionId("ins_1"), stream=1, seq=1, status="ACCEPTED")
    mission = CurrentMission(
        mission_id=MissionId("msn_1"),
        revision=1,
        delivery_id=DeliveryId("dlv_1"),
        accepted_by=answer,
        expires_at=START + timedelta(hours=1),
        first_step=steps[0].step_id,
        steps=tuple(steps),
        released_through=0,
        free_at=START,
    )
    return Logbook(
        station_id=first_flight.from_id,
        position=first_flight.from_position,
        soc=soc,
        mission=mission,
    )


def _landing_from(steps: Sequence[FlightStep], step: FlightStep) -> int:
    """The step through which all is released once this one begins."""
    if not isinstance(step, FlyStep):
        return step.step_id
    ahead = [one for one in steps if isinstance(one, FlyStep) and one.step_id >= step.step_id]
    return next(one.step_id for one in ahead if one.lands)


def _ended(run: StepRun, outcome: Outcome) -> DroneEvent:
    step = run.step
    position: Position = step.to_position if isinstance(step, FlyStep) else run.position
    station_id: StationId = end_of(step)
    return DroneEvent(
        message_id=f"msg_{step.step_id}",
        sent_at=outcome.ended_at,
        session=1,
        seq=step.step_id,
        event="STEP_ENDED",
        stream=1,
        mission_id=MissionId("msn_1"),
        step_id=step.step_id,
        step_kind=step.kind,
        started_at=run.started_at,
        ended_at=outcome.ended_at,
        station_id=station_id,
        position=position,
        soc=outcome.soc,
        energy_j=outcome.energy_j,
    )
