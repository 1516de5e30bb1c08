"""The state of a drone that its provider sees: a pure decision."""

from datetime import datetime
from typing import Literal

from skyway_provider_registry.presence.drone_presence import Presence

DroneStateName = Literal[
    "REGISTERED",
    "AVAILABLE",
    "RESERVED",
    "ON_MISSION",
    "RECHARGING",
    "OFFLINE",
    "MAINTENANCE",
    "GROUNDED",
]


def state_of(presence: Presence, *, is_in_maintenance: bool, wall_now: datetime) -> DroneStateName:
    """The state of a drone with this presence."""
    return state_named(
        is_in_maintenance=is_in_maintenance,
        has_connected=presence.connection is not None,
        is_online=presence.is_online(wall_now),
        activity=None if presence.state is None else presence.state.activity,
        has_mission=presence.mission_id is not None,
        mission_state=presence.mission_state,
        names_mission=presence.names_mission,
    )


def state_named(
    *,
    is_in_maintenance: bool,
    has_connected: bool,
    is_online: bool,
    activity: str | None,
    has_mission: bool,
    mission_state: str | None,
    names_mission: bool,
) -> DroneStateName:
    """The state of a drone; a cause that keeps it from flying comes before its activity.

    A drone is ON_MISSION from the first step of its mission to the mission's end. Composition
    reports to the registry only that a mission was accepted and that it ended. So the drone's own
    `state` message shows the beginning: it names the mission (`names_mission`) and is not IDLE.
    """
    if is_in_maintenance:
        return "MAINTENANCE"
    if not has_connected:
        return "REGISTERED"
    if not is_online:
        return "OFFLINE"
    if activity is None:
        return "REGISTERED"
    if activity == "DOWN":
        return "GROUNDED"
    is_before_start = mission_state in ("BOOKED", "ACCEPTED")
    has_begun = not is_before_start or (names_mission and activity != "IDLE")
    if has_mission and has_begun:
        return "ON_MISSION"
    if activity == "RECHARGING":
        return "RECHARGING"
    return "RESERVED" if has_mission else "AVAILABLE"
