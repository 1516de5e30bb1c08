"""Judges the end of a step; a mission with an impossible report waits for an operator."""

from typing import Final

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import FlightStep
from skyway.runtime.clock import fleet_margin
from skyway.units import ms_to_moment
from skyway_composition.missions.following.plausibility import (
    HandOver,
    why_impossible,
    why_too_early,
)
from skyway_composition.missions.mission.doubt import put_in_doubt
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.step_store import steps_of
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork

#: How far a drone's clock may be behind ours, fleet and wall seconds. Our own choice.
_CLOCK_ERROR_S: Final = (10.0, 1.0)


async def is_believed(
    work: MissionUnitOfWork, record: MissionRecord, step: FlightStep, event: DroneEvent
) -> bool:
    """Whether this end of a step can have happened.

    If not, neither custody nor the step changes: the mission is put in doubt.
    """
    reason = await _why_impossible(work, record, step, event)
    if reason is None:
        return True
    await put_in_doubt(
        work,
        record,
        code="IMPLAUSIBLE",
        detail=f"the end of step {event.step_id} cannot be true: {reason}",
        data={"event": event.model_dump(mode="json", exclude_defaults=True)},
    )
    return False


async def _why_impossible(
    work: MissionUnitOfWork, record: MissionRecord, step: FlightStep, event: DroneEvent
) -> str | None:
    fleet_s, wall_s = _CLOCK_ERROR_S
    clock_error = fleet_margin(work.clock, fleet_s=fleet_s, wall_s=wall_s)
    sent_at = ms_to_moment(record.expires_ms) - work.courier.lifetime - clock_error
    too_early = why_too_early(event, sent_at=sent_at)
    if too_early or event.code == "CUT" or not isinstance(step, HandOver):
        return too_early
    steps = await steps_of(work.tx.connection, record.mission_id)
    earlier = [each for each in steps if each.step.step_id < step.step_id]
    return why_impossible(step, event, earlier, sent_at=sent_at, model=record.candidate.model)
