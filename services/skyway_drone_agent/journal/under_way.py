"""What a drone does now, by its logbook: the step under way, as a vehicle performs it."""

from dataclasses import replace
from datetime import datetime
from itertools import pairwise

from skyway.contracts.flight_step import FlightStep, FlyStep
from skyway_drone_agent.journal.current_mission import CutStep
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.vehicles.vehicle import Standing, StepRun


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
