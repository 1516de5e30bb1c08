"""The state of a drone that its provider sees, from what is known of it."""

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
    """The one state of a drone."""
    return state_named(
        is_in_maintenance=is_in_maintenance,
        has_connected=presence.connection is not None,
        is_online=presence.is_online(wall_now),
        activity=None if presence.state is None else presence.state.activity,
        has_mission=presence.mission_id is not None,
        mission_state=presence.mission_state,
    )


def state_named(
    *,
    is_in_maintenance: bool,
    has_connected: bool,
    is_online: bool,
    activity: str | None,
    has_mission: bool,
    mission_state: str | None,
) -> DroneStateName:
    """The state that follows; what keeps a drone from flying comes before what it is doing."""
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
    if activity == "RECHARGING":
        return "RECHARGING"
    if not has_mission:
        return "AVAILABLE"
    return "RESERVED" if mission_state in ("BOOKED", "ACCEPTED") else "ON_MISSION"
