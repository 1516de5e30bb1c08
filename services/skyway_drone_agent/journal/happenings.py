"""What an event changes in the logbook of the drone that tells it."""

from skyway.contracts.drone_health import Fault
from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import DeliverStep, FlyStep, PickUpStep, ReturnStep
from skyway_drone_agent.journal.current_mission import CurrentMission
from skyway_drone_agent.journal.logbook import Logbook


def happened(logbook: Logbook, event: DroneEvent) -> Logbook:
    """The logbook once this event is told, which the cloud has yet to confirm."""
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
    """The drone stands where the event says, or is down; nothing further is released."""
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
    """Nothing was handed over, and the drone stands where it stood."""
    after = mission.model_copy(
        update={"cut": None, "free_at": max(mission.free_at, event.ended_at)}
    )
    return logbook.model_copy(update={"mission": after, "soc": event.soc})
