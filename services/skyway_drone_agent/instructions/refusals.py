"""Why a drone refuses an instruction, the first reason that holds."""

from datetime import datetime

from skyway.contracts.drone_report import RefusalCode
from skyway.contracts.instruction import (
    AnyInstruction,
    CancelInstruction,
    DivertInstruction,
    HoldInstruction,
    MissionInstruction,
    ReportInstruction,
    ResumeInstruction,
    ReturnHomeInstruction,
)
from skyway.contracts.message import utc_text
from skyway_drone_agent.instructions.overriding import failsafe_against
from skyway_drone_agent.instructions.refusal import Refusal
from skyway_drone_agent.instructions.refused_steps import not_these_steps
from skyway_drone_agent.journal.calling_off import can_be_called_off
from skyway_drone_agent.journal.current_mission import CurrentMission
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.revision import CUTTABLE, Revision
from skyway_drone_agent.vehicles.vehicle import Vehicle


def refusal_of(
    instruction: AnyInstruction,
    logbook: Logbook,
    *,
    vehicle: Vehicle,
    now: datetime,
    consumption_factor: float = 1.0,
) -> Refusal | None:
    """Why the drone will not do this; None when it will."""
    if now > instruction.expires_at:
        detail = f"expired at {utc_text(instruction.expires_at)}, it is {utc_text(now)}"
        return Refusal(RefusalCode.EXPIRED, detail)
    match instruction:
        case MissionInstruction() | DivertInstruction() | ReturnHomeInstruction():
            return (
                _not_this_revision(instruction, logbook)
                or failsafe_against(instruction, logbook)
                or not_these_steps(
                    instruction,
                    logbook,
                    vehicle=vehicle,
                    now=now,
                    consumption_factor=consumption_factor,
                )
            )
        case HoldInstruction() | ResumeInstruction():
            return _not_flown(instruction, logbook)
        case CancelInstruction():
            return _no_way_back(instruction, logbook)
        case ReportInstruction():
            return None


def _not_this_revision(instruction: Revision, logbook: Logbook) -> Refusal | None:
    mission = logbook.mission
    if mission is None and isinstance(instruction, MissionInstruction):
        return _is_over(instruction, logbook)
    if mission is not None and instruction.mission_id != mission.mission_id:
        return _is_over(instruction, logbook) or Refusal(
            RefusalCode.OTHER_MISSION_ACTIVE,
            f"{mission.mission_id} is not over",
            {"mission_id": mission.mission_id},
        )
    if mission is None or mission.is_called_off:
        return _not_flown(instruction, logbook)
    if instruction.mission_revision <= mission.revision:
        return Refusal(
            RefusalCode.STALE_REVISION,
            f"revision {instruction.mission_revision} is not after revision {mission.revision}",
            {"mission_revision": mission.revision},
        )
    return _released(instruction, mission)


def _released(instruction: Revision, mission: CurrentMission) -> Refusal | None:
    """A step that ended is not replaced, and one under way only where it can end at once."""
    if isinstance(instruction, MissionInstruction) or mission.has_failed:
        first_free = mission.released_through + 1
    elif mission.step_under_way is None or isinstance(mission.step_under_way, CUTTABLE):
        first_free = mission.next_step_id
    else:
        first_free = mission.next_step_id + 1
    if instruction.first_step >= first_free:
        return None
    return Refusal(
        RefusalCode.STEP_RELEASED,
        f"step {instruction.first_step} is no more replaced, step {first_free} is the first",
        {"released_through": mission.released_through, "step_id": mission.next_step_id},
    )


def _is_over(instruction: Revision | CancelInstruction, logbook: Logbook) -> Refusal | None:
    if instruction.mission_id not in logbook.ended_mission_ids:
        return None
    return Refusal(RefusalCode.STALE_REVISION, f"{instruction.mission_id} is over")


def _not_flown(
    instruction: Revision | HoldInstruction | ResumeInstruction, logbook: Logbook
) -> Refusal | None:
    mission = logbook.mission
    if mission is None or mission.mission_id != instruction.mission_id:
        return Refusal(RefusalCode.STALE_REVISION, f"{instruction.mission_id} is not flown")
    if mission.is_called_off:
        return Refusal(RefusalCode.STALE_REVISION, f"{instruction.mission_id} is called off")
    return None


def _no_way_back(instruction: CancelInstruction, logbook: Logbook) -> Refusal | None:
    mission = logbook.mission
    if mission is None or mission.mission_id != instruction.mission_id:
        # What is not there is forgotten already.
        return _is_over(instruction, logbook)
    can_stop = can_be_called_off(
        mission, is_airborne=logbook.is_airborne, is_loaded=bool(logbook.packages)
    )
    if can_stop:
        return None
    detail = f"steps through {mission.released_through} are released"
    return Refusal(
        RefusalCode.STEP_RELEASED, detail, {"released_through": mission.released_through}
    )
