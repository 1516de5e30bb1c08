"""What each record of the journal changes in the logbook."""

from datetime import datetime
from typing import Final

from skyway.contracts.drone_report import DroneEvent, Fault
from skyway.contracts.flight_step import DeliverStep, FlyStep, PickUpStep, ReturnStep
from skyway.contracts.instruction import (
    AnyInstruction,
    CancelInstruction,
    DivertInstruction,
    HandOverInstruction,
    HoldInstruction,
    MissionInstruction,
    ResumeInstruction,
    ReturnHomeInstruction,
)
from skyway_drone_agent.journal.logbook import CurrentMission, Logbook
from skyway_drone_agent.journal.mission_changes import (
    called_off,
    mission_after,
    mission_escaping,
    mission_overridden,
    with_proofs,
)
from skyway_drone_agent.journal.records import (
    AcceptanceSent,
    Answer,
    EventRecorded,
    FailsafeBegun,
    FailsafeOverridden,
    FaultEnded,
    HealthLearned,
    InstructionAnswered,
    Placed,
    Record,
    StepBegun,
)


def logbook_after(logbook: Logbook, record: Record) -> Logbook:
    """The logbook once this record is written."""
    match record:
        case InstructionAnswered():
            return after_answer(logbook, record)
        case AcceptanceSent():
            return _acceptance_sent(logbook, record)
        case StepBegun():
            return _begun(logbook, record)
        case EventRecorded():
            return after_event(logbook, record.event)
        case FailsafeBegun():
            return _escaping(logbook, record)
        case FailsafeOverridden():
            return _overridden(logbook, record)
        case FaultEnded():
            faults = tuple(fault for fault in logbook.faults if fault is not record.fault)
            return logbook.model_copy(update={"faults": faults})
        case HealthLearned():
            return logbook.model_copy(update={"state_of_health": record.state_of_health})
        case Placed():
            return _placed(logbook, record)


def _acceptance_sent(logbook: Logbook, record: AcceptanceSent) -> Logbook:
    if logbook.mission is None:
        return logbook
    mission = logbook.mission.model_copy(update={"acceptance_sent_at": record.acceptance_sent_at})
    return logbook.model_copy(update={"mission": mission})


def _begun(logbook: Logbook, record: StepBegun) -> Logbook:
    if logbook.mission is None:
        return logbook
    mission = logbook.mission.model_copy(
        update={"began_at": record.started_at, "released_through": record.released_through}
    )
    is_flying = isinstance(mission.steps[0], FlyStep)
    station_id = None if is_flying else logbook.station_id
    return logbook.model_copy(update={"mission": mission, "station_id": station_id})


def _escaping(logbook: Logbook, record: FailsafeBegun) -> Logbook:
    """The flight under way starts again from here."""
    if logbook.mission is None:
        return logbook
    return logbook.model_copy(
        update={
            "mission": mission_escaping(logbook.mission, record),
            "position": record.flight.from_position,
            "soc": record.soc,
        }
    )


def _overridden(logbook: Logbook, record: FailsafeOverridden) -> Logbook:
    if logbook.mission is None:
        return logbook
    changes: dict[str, object] = {"mission": mission_overridden(logbook.mission, record)}
    if record.flight is not None:
        changes |= {"position": record.flight.from_position, "soc": record.soc}
    return logbook.model_copy(update=changes)


def _placed(logbook: Logbook, record: Placed) -> Logbook:
    """The mission in which the drone went down is over."""
    changes = {"is_down": False, "station_id": record.station_id, "position": record.position}
    return logbook.model_copy(update=changes).without_mission().model_copy(update={"packages": ()})


def after_event(logbook: Logbook, event: DroneEvent) -> Logbook:
    """The logbook with this event, which the cloud has not confirmed yet."""
    logbook = logbook.model_copy(
        update={"last_event_seq": event.seq, "events": (*logbook.events, event)}
    )
    if event.event == "ALARM":
        return _alarmed(logbook, event)
    mission = logbook.mission
    if mission is None:
        return logbook
    match event.event:
        case "MISSION_ENDED":
            return logbook.without_mission()
        case "STEP_FAILED":
            logbook = _step_failed(logbook, mission, event)
        case "STEP_ENDED" if mission.cut is None:
            logbook = _step_ended(logbook, mission, event)
        case "STEP_ENDED":
            logbook = _cut_step_ended(logbook, mission, event)
    left = logbook.mission
    is_over = left is not None and left.is_called_off and (left.has_failed or not left.steps)
    return logbook.without_mission() if is_over else logbook


def _alarmed(logbook: Logbook, event: DroneEvent) -> Logbook:
    new = tuple(fault for fault in Fault if fault == event.code and fault not in logbook.faults)
    return logbook.model_copy(update={"faults": (*logbook.faults, *new)})


def _step_failed(logbook: Logbook, mission: CurrentMission, event: DroneEvent) -> Logbook:
    """The drone stands where the event says, or is down; no further step is released.

    A hand-over without all of its proofs has handed over the packages that the event names.
    """
    step, packages = mission.steps[0], logbook.packages
    if isinstance(step, DeliverStep):
        packages = tuple(one for one in packages if one.package_id not in event.package_ids)
    failed = mission.model_copy(
        update={
            "has_failed": True,
            "free_at": event.ended_at,
            "began_at": None,
            "changed_at": None,
            "escape": None,
            "flown_before": None,
        }
    )
    return logbook.model_copy(
        update={
            "mission": failed,
            "station_id": event.station_id,
            "position": event.position,
            "soc": event.soc,
            "packages": packages,
            "is_down": event.station_id is None,
        }
    )


def _step_ended(logbook: Logbook, mission: CurrentMission, event: DroneEvent) -> Logbook:
    step, *remaining = mission.steps
    packages = logbook.packages
    if isinstance(step, PickUpStep):
        packages = (*packages, *step.packages)
    if isinstance(step, DeliverStep | ReturnStep):
        packages = tuple(one for one in packages if one.package_id not in step.package_ids)
    lands = not isinstance(step, FlyStep) or step.lands
    changes = {
        "steps": tuple(remaining),
        "began_at": None,
        "changed_at": None,
        "escape": None,
        "flown_before": None,
        "free_at": event.ended_at,
    }
    return logbook.model_copy(
        update={
            "mission": mission.model_copy(update=changes),
            "station_id": event.station_id if lands else None,
            "position": event.position,
            "soc": event.soc,
            "packages": packages,
        }
    )


def _cut_step_ended(logbook: Logbook, mission: CurrentMission, event: DroneEvent) -> Logbook:
    """No package was handed over, and the drone has not moved."""
    after = mission.model_copy(
        update={"cut": None, "free_at": max(mission.free_at, event.ended_at)}
    )
    return logbook.model_copy(update={"mission": after, "soc": event.soc})


#: Number of answers that are kept for repeated instructions; older ones are surely settled.
_ANSWERS_KEPT: Final = 64


def after_answer(logbook: Logbook, record: InstructionAnswered) -> Logbook:
    """The logbook after an answer; an accepted instruction is carried out."""
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
    return _carried_out(logbook, instruction, answer=answer, at=record.answered_at)


def _carried_out(
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
            changed = before.model_copy(update={"is_held": True})
        case ResumeInstruction():
            free_at = before.free_at if is_airborne else max(at, before.free_at)
            changed = before.model_copy(update={"is_held": False, "free_at": free_at})
        case HandOverInstruction():
            changed = with_proofs(before, instruction.package_ids, at=at)
    return logbook.model_copy(update={"mission": changed})


def _called_off(logbook: Logbook, before: CurrentMission, *, at: datetime) -> Logbook:
    left = called_off(before, at=at, is_airborne=logbook.is_airborne)
    if left is not None:
        return logbook.model_copy(update={"mission": left})
    return logbook.without_mission()
