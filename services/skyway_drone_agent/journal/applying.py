"""What each record of a journal changes in the logbook."""

from skyway.contracts.flight_step import FlyStep
from skyway_drone_agent.journal.escape import mission_escaping, mission_overridden
from skyway_drone_agent.journal.happenings import happened
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.obeying import answered
from skyway_drone_agent.journal.records import (
    AcceptanceTold,
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
            return answered(logbook, record)
        case AcceptanceTold():
            return _told(logbook, record)
        case StepBegun():
            return _begun(logbook, record)
        case EventRecorded():
            return happened(logbook, record.event)
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


def _told(logbook: Logbook, record: AcceptanceTold) -> Logbook:
    if logbook.mission is None:
        return logbook
    mission = logbook.mission.model_copy(update={"told_at": record.told_at})
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
    """What is under way begins anew, here."""
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
    """The mission in which it went down is over."""
    changes = {"is_down": False, "station_id": record.station_id, "position": record.position}
    return logbook.model_copy(update=changes).without_mission().model_copy(update={"packages": ()})
