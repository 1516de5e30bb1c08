"""What an answered instruction changes in the logbook."""

from datetime import datetime
from typing import Final

from skyway.contracts.instruction import (
    AnyInstruction,
    CancelInstruction,
    DivertInstruction,
    HoldInstruction,
    MissionInstruction,
    ResumeInstruction,
    ReturnHomeInstruction,
)
from skyway_drone_agent.journal.calling_off import called_off
from skyway_drone_agent.journal.current_mission import CurrentMission
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.records import Answer, InstructionAnswered
from skyway_drone_agent.journal.revision import mission_after

#: So many answers are kept for instructions that come again; older ones are surely settled.
_ANSWERS_KEPT: Final = 64


def answered(logbook: Logbook, record: InstructionAnswered) -> Logbook:
    """The logbook once an instruction is answered, and obeyed if it was accepted."""
    answer, instruction = record.answer, record.instruction
    confirmed_seq = instruction.events_confirmed_seq if instruction else 0
    logbook = logbook.model_copy(
        update={
            "stream": answer.stream,
            "last_instruction_seq": answer.seq,
            "answers": (*logbook.answers, answer)[-_ANSWERS_KEPT:],
            "events": tuple(event for event in logbook.events if event.seq > confirmed_seq),
        }
    )
    if answer.status == "REJECTED" or instruction is None:
        return logbook
    return _obeyed(logbook, instruction, answer=answer, at=record.answered_at)


def _obeyed(
    logbook: Logbook, instruction: AnyInstruction, *, answer: Answer, at: datetime
) -> Logbook:
    before, is_airborne = logbook.mission, logbook.is_airborne
    if isinstance(instruction, MissionInstruction | DivertInstruction | ReturnHomeInstruction):
        mission = mission_after(before, instruction, answer=answer, at=at, is_airborne=is_airborne)
        return logbook.model_copy(update={"mission": mission})
    if before is None or before.mission_id != instruction.mission_id:
        # A cancel of a mission that the drone does not have changes nothing.
        return logbook
    match instruction:
        case CancelInstruction():
            return _called_off(logbook, before, at=at)
        case HoldInstruction():
            held = before.model_copy(update={"is_held": True})
        case ResumeInstruction():
            free_at = before.free_at if is_airborne else max(at, before.free_at)
            held = before.model_copy(update={"is_held": False, "free_at": free_at})
    return logbook.model_copy(update={"mission": held})


def _called_off(logbook: Logbook, before: CurrentMission, *, at: datetime) -> Logbook:
    left = called_off(before, at=at, is_airborne=logbook.is_airborne)
    if left is not None:
        return logbook.model_copy(update={"mission": left})
    return logbook.without_mission()
