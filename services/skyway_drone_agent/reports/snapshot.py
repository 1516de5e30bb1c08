"""A drone's state for the cloud, made from its logbook and the assessment of its sensors."""

from typing import Literal

from skyway.contracts.drone_health import DroneHealth, Wind
from skyway.contracts.drone_report import DroneState
from skyway_drone_agent.analysis.analysis import Assessment
from skyway_drone_agent.failsafes.failsafe import active_failsafe, in_order_of_danger
from skyway_drone_agent.journal.logbook import Logbook, run_under_way
from skyway_drone_agent.link.uplink import Envelope
from skyway_drone_agent.vehicle import StepRun

_Activity = Literal["IDLE", "LOADING", "FLYING", "WAITING", "RECHARGING", "DELIVERING", "DOWN"]

_ACTIVITY_OF_STEP: dict[str, _Activity] = {
    "PICK_UP": "LOADING",
    "FLY": "FLYING",
    "WAIT": "WAITING",
    "RECHARGE": "RECHARGING",
    "DELIVER": "DELIVERING",
    "RETURN": "DELIVERING",
}


def snapshot_of(logbook: Logbook, assessment: Assessment, *, envelope: Envelope) -> DroneState:
    """The state at the assessment; `step_id` is the step under way or the next one."""
    mission, run = logbook.mission, run_under_way(logbook)
    step_id = mission.steps[0].step_id if mission and mission.steps else None
    return DroneState(
        **envelope,
        traceparent=mission.accepted_by.traceparent if mission else None,
        at=assessment.at,
        activity=_activity_of(logbook, run),
        stream=logbook.stream,
        last_instruction_seq=logbook.last_instruction_seq,
        journal_session=logbook.first_session,
        last_event_seq=logbook.last_event_seq,
        mission_id=mission.mission_id if mission else None,
        mission_revision=mission.revision if mission else None,
        step_id=step_id,
        released_through=mission.released_through if mission else None,
        is_held=mission is not None and mission.is_held,
        station_id=logbook.station_id,
        position=assessment.position,
        soc=assessment.soc,
        load_kg=logbook.load_kg,
        package_ids=tuple(package.package_id for package in logbook.packages),
        health=health_of(assessment),
        faults=in_order_of_danger(logbook.faults),
        failsafe=active_failsafe(logbook),
    )


def health_of(assessment: Assessment) -> DroneHealth:
    """The results of the analysis on board, as they are sent."""
    wind = assessment.wind_mps
    return DroneHealth(
        voltage_v=assessment.voltage_v,
        current_a=assessment.current_a,
        soc_error=assessment.soc_error,
        cell_spread_v=assessment.cell_spread_v,
        temperature_c=assessment.temperature_c,
        state_of_health=assessment.state_of_health,
        consumption_factor=assessment.consumption_factor,
        range_m=assessment.range_m,
        wind=Wind(east_mps=wind[0], north_mps=wind[1]) if wind else None,
        safe_landings=tuple(landing.station_id for landing in assessment.safe_landings),
    )


def _activity_of(logbook: Logbook, run: StepRun | None) -> _Activity:
    if logbook.is_down:
        return "DOWN"
    if run is not None:
        return _ACTIVITY_OF_STEP[run.step.kind]
    mission = logbook.mission
    if mission is None or mission.released_through < mission.first_step:
        return "IDLE"
    return "WAITING"
