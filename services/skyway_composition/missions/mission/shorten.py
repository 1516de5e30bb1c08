"""Ends a drone's standby early, so that its next mission can begin."""

from collections.abc import Sequence

from skyway.contracts.flight_step import FlightStep, RechargeStep, WaitStep
from skyway.contracts.mission import Mission
from skyway.scheduling.standby import SAME_MS, shortened_plan, shortened_step
from skyway.units import moment_to_ms, ms_to_moment


def shortened_mission(mission: Mission, *, served_ms: int, until_ms: int) -> Mission:
    """The mission without the part of its standby after `until_ms`.

    `served_ms` is the end of its plan, from which the seconds of its standby count.
    """
    until_s = (until_ms - served_ms) / 1000
    home_plan, home_recharge = mission.home_plan, mission.home_recharge
    return mission.model_copy(
        update={
            "home_plan": None if home_plan is None else shortened_plan(home_plan, until_s),
            "home_recharge": None
            if home_recharge is None
            else shortened_step(home_recharge, until_s),
            "released_at": ms_to_moment(min(until_ms, moment_to_ms(mission.released_at))),
        }
    )


def shortened_steps(
    steps: Sequence[FlightStep], *, until_ms: int
) -> tuple[int, tuple[FlightStep, ...]] | None:
    """The first step that changes, and the steps that replace it and all after it.

    None when no step ends after `until_ms`. A recharge or wait under way then is shortened; all
    later steps are left out.
    """
    until_at = ms_to_moment(until_ms)
    for step in steps:
        if moment_to_ms(step.planned_end_at) <= until_ms + SAME_MS:
            continue
        if moment_to_ms(step.planned_start_at) >= until_ms - SAME_MS:
            return step.step_id, ()
        if isinstance(step, RechargeStep):
            update = {"planned_end_at": until_at, "not_after_at": min(step.not_after_at, until_at)}
            return step.step_id, (step.model_copy(update=update),)
        if isinstance(step, WaitStep):
            update = {"planned_end_at": until_at, "until_at": until_at}
            return step.step_id, (step.model_copy(update=update),)
        raise ValueError(f"step {step.step_id} ({step.kind}) cannot end at {until_at}")
    return None
