"""The drone itself, as the agent sees it: something that performs steps and can be looked at."""

from dataclasses import dataclass, replace
from datetime import datetime
from itertools import pairwise
from typing import Protocol

from skyway.contracts.flight_step import FlightStep, FlyStep
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import StationId
from skyway_drone_agent.current_mission import CutStep
from skyway_drone_agent.logbook import Logbook
from skyway_drone_agent.reading import Reading


@dataclass(frozen=True, slots=True)
class StepRun:
    """A step that has begun, with what the drone had then.

    `changed_at` is when an instruction last changed the step under way: it ends no earlier.
    `onward` are the flights that follow a flight which does not land, up to the landing.
    """

    step: FlightStep
    started_at: datetime
    soc: float
    load_kg: float
    position: Position
    changed_at: datetime | None = None
    onward: tuple[FlyStep, ...] = ()


@dataclass(frozen=True, slots=True)
class Standing:
    """A drone between two steps; a simulated one knows only so where it is."""

    position: Position
    soc: float
    load_kg: float


@dataclass(frozen=True, slots=True)
class Elsewhere:
    """Where a drone is that has not come to its step's end; without a station it is down."""

    station_id: StationId | None
    position: Position


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a step ended; `code` when it ended otherwise than asked, or did not come about.

    `elsewhere` is where the drone is after a step that failed or was broken off, if known better
    than by where the step leads.
    """

    ended_at: datetime
    soc: float
    energy_j: float
    code: str | None = None
    has_failed: bool = False
    elsewhere: Elsewhere | None = None


@dataclass(frozen=True, slots=True)
class Sample:
    """What the drone's sensors show; `power_w` is what the flight draws."""

    position: Position
    soc: float
    power_w: float
    speed_mps: float


class Vehicle(Protocol):
    """What the agent needs of a drone, flown for real or simulated."""

    @property
    def model(self) -> DroneModel:
        """The type of drone."""
        ...

    async def perform(self, run: StepRun) -> Outcome:
        """Do the step and return at its end; the same run again goes on with it.

        Cancelled when an instruction changes the step or cuts it short.
        """
        ...

    def cut(self, run: StepRun, at: datetime) -> Outcome:
        """End a step on the ground at this moment, or when it ended by itself before."""
        ...

    def sample(self, run: StepRun, at: datetime) -> Sample:
        """How far the step has come at this moment."""
        ...

    def read(self, doing: StepRun | Standing, at: datetime) -> Reading:
        """What the sensors show at this moment."""
        ...

    async def land(self, run: StepRun) -> Outcome:
        """End a flight here and now, wherever that is, and return once the drone is down."""
        ...

    def recall(self, run: StepRun) -> bool | None:
        """Whether a hand-over that had begun before a restart was done; None: it cannot know."""
        ...


def doing_now(logbook: Logbook) -> StepRun | Standing:
    """What the drone does, or where it stands."""
    run = run_under_way(logbook)
    return run or Standing(logbook.position, logbook.soc, logbook.load_kg)


def run_under_way(logbook: Logbook) -> StepRun | None:
    """The step that has begun and not ended, after a restart too."""
    mission = logbook.mission
    if mission is None or mission.began_at is None:
        return None
    run = _run(
        logbook, mission.steps[0], started_at=mission.began_at, changed_at=mission.changed_at
    )
    onward = _onward(mission.steps)
    return replace(run, onward=onward) if onward else run


def run_to_cut(logbook: Logbook, cut: CutStep) -> StepRun:
    """The step that an instruction has cut, and whose end is not written yet."""
    return _run(logbook, cut.step, started_at=cut.began_at, changed_at=None)


def _onward(steps: tuple[FlightStep, ...]) -> tuple[FlyStep, ...]:
    """The flights behind the first step, up to the one that lands."""
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
