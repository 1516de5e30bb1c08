"""The logbook: the sum of the journal's records, and what the drone does now by it."""

from dataclasses import replace
from datetime import datetime
from itertools import pairwise
from typing import Final, Self

from pydantic import Field

from skyway.contracts.drone_health import Fault
from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import FlightStep, FlyStep, PackageOnBoard
from skyway.contracts.message import Soc
from skyway.geo import Position
from skyway.ids import MissionId, StationId
from skyway.json_model import WireModel
from skyway_drone_agent.journal.current_mission import CurrentMission, CutStep
from skyway_drone_agent.journal.records import Answer
from skyway_drone_agent.vehicle import Standing, StepRun

#: Number of ended missions that are remembered, to refuse late revisions of them.
_ENDED_MISSIONS_KEPT: Final = 16


class Logbook(WireModel):
    """Everything that a drone needs after a restart.

    `station_id` is None in the air, and when the drone is down, which means away from every
    station. `faults` are the current faults with an alarm. `state_of_health` is the last estimate
    of the battery's capacity, as a share of the capacity when new. `first_session` is the session
    in which the journal was begun, 0 in the journal of an older version before its next start.
    """

    session: int = 0
    first_session: int = 0
    stream: int = 0
    last_instruction_seq: int = 0
    answers: tuple[Answer, ...] = ()
    last_event_seq: int = 0
    events: tuple[DroneEvent, ...] = Field(default=(), description="not confirmed by the cloud")
    mission: CurrentMission | None = None
    ended_mission_ids: tuple[MissionId, ...] = ()
    station_id: StationId | None
    position: Position
    soc: Soc
    packages: tuple[PackageOnBoard, ...] = ()
    is_down: bool = False
    faults: tuple[Fault, ...] = ()
    state_of_health: Soc = 1.0

    @property
    def is_airborne(self) -> bool:
        """Whether the drone flies."""
        return self.station_id is None and not self.is_down

    @property
    def load_kg(self) -> float:
        """The mass of all packages on board."""
        return sum(package.mass_kg for package in self.packages)

    def without_mission(self) -> Self:
        """The logbook after its mission, if it has one.

        Packages on board are stranded: they stay at the station where the drone stands. A drone
        that is down keeps them on board until people come.
        """
        if self.mission is None:
            return self
        ended = (*self.ended_mission_ids, self.mission.mission_id)[-_ENDED_MISSIONS_KEPT:]
        packages = self.packages if self.is_down else ()
        return self.model_copy(
            update={"mission": None, "ended_mission_ids": ended, "packages": packages}
        )


def doing_now(logbook: Logbook) -> StepRun | Standing:
    """The step under way, or where the drone stands."""
    run = run_under_way(logbook)
    return run or Standing(logbook.position, logbook.soc, logbook.load_kg)


def run_under_way(logbook: Logbook) -> StepRun | None:
    """The step that has begun and not ended, also after a restart; None without one."""
    mission = logbook.mission
    if mission is None or mission.began_at is None:
        return None
    run = _run(
        logbook, mission.steps[0], started_at=mission.began_at, changed_at=mission.changed_at
    )
    onward = _onward(mission.steps)
    return replace(run, onward=onward) if onward else run


def run_to_cut(logbook: Logbook, cut: CutStep) -> StepRun:
    """The step that an instruction has cut and whose end is not written yet."""
    return _run(logbook, cut.step, started_at=cut.began_at, changed_at=None)


def _onward(steps: tuple[FlightStep, ...]) -> tuple[FlyStep, ...]:
    """The flights after the first step, up to the flight that lands."""
    onward: list[FlyStep] = []
    for step, after in pairwise(steps):
        if not isinstance(step, FlyStep) or step.lands or not isinstance(after, FlyStep):
            break
        onward.append(after)
    return tuple(onward)


def _run(
    logbook: Logbook, step: FlightStep, *, started_at: datetime, changed_at: datetime | None
) -> StepRun:
    return StepRun(
        step=step,
        started_at=started_at,
        soc=logbook.soc,
        load_kg=logbook.load_kg,
        position=logbook.position,
        changed_at=changed_at,
    )
