"""Calling a mission off: when a drone can forget it, and what it must still do first."""

from datetime import datetime

from skyway.contracts.flight_step import FlightStep, PickUpStep, RechargeStep, WaitStep
from skyway_drone_agent.journal.current_mission import CurrentMission


def can_be_called_off(mission: CurrentMission, *, is_airborne: bool, is_loaded: bool) -> bool:
    """Whether nothing is on board nor being loaded, or the mission has failed and waits."""
    if mission.has_failed or mission.released_through < mission.first_step:
        return True
    step = mission.step_under_way
    return not is_loaded and (is_airborne or step is None or _can_end_at_once(step))


def called_off(
    mission: CurrentMission, *, at: datetime, is_airborne: bool
) -> CurrentMission | None:
    """What is left of the mission: the way to the next landing, a step to cut; None at once."""
    if is_airborne:
        released = tuple(step for step in mission.steps if step.step_id <= mission.released_through)
        return mission.model_copy(update={"steps": released, "is_called_off": True})
    cut = mission.cut_of_step_under_way(at)
    if cut is None:
        return None
    return mission.model_copy(
        update={"steps": (), "began_at": None, "cut": cut, "is_called_off": True}
    )


def _can_end_at_once(step: FlightStep) -> bool:
    if isinstance(step, PickUpStep):
        return step.awaits_confirmation
    return isinstance(step, WaitStep | RechargeStep)
