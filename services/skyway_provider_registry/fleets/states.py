"""The state of a drone that its provider sees, from what is known of it."""

from datetime import datetime
from typing import Literal

from skyway_provider_registry.presence.known import Presence

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
    """The one state of a drone; what keeps it from flying comes before what it is doing."""
    if is_in_maintenance:
        return "MAINTENANCE"
    if presence.connection is None:
        return "REGISTERED"
    if not presence.is_online(wall_now):
        return "OFFLINE"
    if presence.state is None:
        return "REGISTERED"
    if presence.state.activity == "DOWN":
        return "GROUNDED"
    if presence.state.activity == "RECHARGING":
        return "RECHARGING"
    if presence.mission_id is None:
        return "AVAILABLE"
    return "RESERVED" if presence.mission_state in ("BOOKED", "ACCEPTED") else "ON_MISSION"
