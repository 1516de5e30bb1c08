"""A drone's state as the cloud sees it, made from its logbook."""

from datetime import datetime
from typing import Literal

from skyway.contracts.drone_report import DroneState
from skyway_drone_agent.logbook import Logbook
from skyway_drone_agent.uplink import Envelope
from skyway_drone_agent.vehicle import StepRun, Vehicle, run_under_way

_Activity = Literal["IDLE", "LOADING", "FLYING", "WAITING", "RECHARGING", "DELIVERING"]

_ACTIVITY_OF_STEP: dict[str, _Activity] = {
    "PICK_UP": "LOADING",
    "FLY": "FLYING",
    "WAIT": "WAITING",
    "RECHARGE": "RECHARGING",
    "DELIVER": "DELIVERING",
    "RETURN": "DELIVERING",
}


def snapshot_of(
    logbook: Logbook, vehicle: Vehicle, *, at: datetime, envelope: Envelope
) -> DroneState:
    """The state at this moment; `step_id` is the step that is done or waited for."""
    mission, run = logbook.mission, run_under_way(logbook)
    sample = vehicle.sample(run, at) if run else None
    step_id = mission.steps[0].step_id if mission and mission.steps else None
    return DroneState(
        **envelope,
        traceparent=mission.accepted_by.traceparent if mission else None,
        at=at,
        activity=_activity_of(logbook, run),
        stream=logbook.stream,
        last_instruction_seq=logbook.last_instruction_seq,
        last_event_seq=logbook.last_event_seq,
        mission_id=mission.mission_id if mission else None,
        mission_revision=mission.revision if mission else None,
        step_id=step_id,
        released_through=mission.released_through if mission else None,
        is_held=mission is not None and mission.is_held,
        station_id=logbook.station_id,
        position=sample.position if sample else logbook.position,
        soc=sample.soc if sample else logbook.soc,
        load_kg=logbook.load_kg,
        package_ids=tuple(package.package_id for package in logbook.packages),
    )


def _activity_of(logbook: Logbook, run: StepRun | None) -> _Activity:
    if run is not None:
        return _ACTIVITY_OF_STEP[run.step.kind]
    mission = logbook.mission
    if mission is None or mission.released_through < mission.first_step:
        return "IDLE"
    return "WAITING"
