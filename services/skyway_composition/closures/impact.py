"""Whom a closure concerns: missions know, closures only ask."""

from dataclasses import dataclass
from datetime import datetime
from typing import Protocol

from skyway.ids import DeliveryId, DroneId, MissionId, ProviderId, StationId
from skyway.json_model import JsonModel
from skyway.planner.airspace import SegmentEnds
from skyway.runtime.sql.database import Database, Tx
from skyway_composition.closures.closure import Closure


class AffectedMission(JsonModel):
    """A mission that would land, charge, fly or take off where that is closed, and when first."""

    mission_id: MissionId
    drone_id: DroneId
    provider_id: ProviderId
    delivery_id: DeliveryId
    station_id: StationId | None
    at: datetime
    is_flying: bool


@dataclass(frozen=True, slots=True)
class Reach:
    """A closure with the stations and segments of the network that it reaches.

    At `stations` nobody lands; for a ground stop nobody takes off, and None means everywhere.
    Drones may be `late_ms` late without another plan. `what` says in words what is closed where
    the closure does not: it stands for what a new version of the network took away.
    """

    closure: Closure
    stations: frozenset[StationId] | None = frozenset()
    segments: frozenset[SegmentEnds] = frozenset()
    late_ms: int = 0
    what: str | None = None


class Impact(Protocol):
    """What a closure does to the missions that are under way."""

    async def preview(self, db: Database, reach: Reach) -> tuple[AffectedMission, ...]:
        """The missions that it would hit, the first to be hit first."""
        ...

    async def strike(self, tx: Tx, reach: Reach) -> tuple[AffectedMission, ...]:
        """The missions that it hits, which look for other plans from now on."""
        ...

    async def relieve(self, tx: Tx, reach: Reach) -> None:
        """Have those that found no plan look again, now that this is lifted."""
        ...
