"""A drone inside the registry: its registration and its presence."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from skyway.contracts.candidate import Standby
from skyway.contracts.mission_reports import FreeFrom
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import DroneId, ProviderId, StationId
from skyway_provider_registry.fleets.drone import (
    Drone,
    DroneStateName,
    MqttAccount,
    RegisteredDrone,
    state_of,
)
from skyway_provider_registry.presence.drone_presence import Presence, condition_of


@dataclass(frozen=True, slots=True)
class FleetDrone:
    """A registered drone; `initial_soc` is its charge until its first `state` message.

    Without a `standby` of its own it has its provider's.
    """

    drone_id: DroneId
    provider_id: ProviderId
    model: DroneModel
    home_station_id: StationId
    home_position: Position
    name: str | None
    registration: str | None
    standby: Standby | None
    initial_soc: float
    is_in_maintenance: bool
    created_at: datetime
    presence: Presence
    free_from: FreeFrom | None = None

    def state(self, wall_now: datetime) -> DroneStateName:
        """Its state at this moment of wall time."""
        return state_of(self.presence, is_in_maintenance=self.is_in_maintenance, wall_now=wall_now)

    def shown(self, wall_now: datetime) -> Drone:
        """The drone as its provider sees it."""
        return Drone.model_construct(**self._members(wall_now))

    def shown_once(self, wall_now: datetime, *, password: str, token: str) -> RegisteredDrone:
        """The drone as its provider sees it once: with its token and its broker account."""
        account = MqttAccount(user_name=self.drone_id, password=password)
        return RegisteredDrone.model_construct(
            **self._members(wall_now), enrolment_token=token, mqtt=account
        )

    def _members(self, wall_now: datetime) -> dict[str, Any]:  # of every type
        """The members of a `Drone`, which are valid already; a fleet has thousands of drones."""
        reported = self.presence.state
        condition = condition_of(reported.condition if reported else None)
        position, soc = self.presence.place or (None, self.initial_soc)
        return {
            "drone_id": self.drone_id,
            "provider_id": self.provider_id,
            "model_id": self.model.model_id,
            "model": self.model,
            "home_station_id": self.home_station_id,
            "home_position": self.home_position,
            "name": self.name,
            "registration": self.registration,
            "standby": self.standby,
            "state": self.state(wall_now),
            "soc": soc,
            "station_id": reported.station_id if reported else None,
            "position": position,
            "activity": reported.activity if reported else None,
            "mission_id": self.presence.mission_id,
            "free_from": self.free_from,
            "health": condition.health,
            "faults": condition.faults,
            "failsafe": condition.failsafe,
            "last_seen_at": self.presence.last_seen_at,
        }
