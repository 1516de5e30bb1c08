"""A closure, the part of a network that it reaches, and the missions that it affects."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Annotated, Literal, Protocol

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import (
    ClosureId,
    ConnectorId,
    DeliveryId,
    DroneId,
    DroneModelId,
    MissionId,
    NetworkId,
    ProviderId,
    StationId,
    ZoneId,
)
from skyway.json_model import JsonModel
from skyway.network.network import Zone
from skyway.planner.airspace import SegmentEnds
from skyway.planner.weather import Weather
from skyway.runtime.sql.database import Database, Tx
from skyway.units import ms_to_moment

#: No drone may land (STATION), charge (PAD), fly (SEGMENT, ZONE) or take off (GROUND_STOP).
ClosureKind = Literal["STATION", "PAD", "SEGMENT", "ZONE", "GROUND_STOP"]


#: The most positions of one ring; a finer border must be simplified. Our own choice.
_MOST_POSITIONS = 10_000


def _closed(ring: tuple[Position, ...]) -> tuple[Position, ...]:
    if ring[0] != ring[-1]:
        raise PydanticCustomError(
            "open_ring", "the ring is not closed: its first and last positions differ"
        )
    return ring


Ring = Annotated[
    tuple[Position, ...],
    Field(min_length=4, max_length=_MOST_POSITIONS),
    AfterValidator(_closed),
]


class Area(JsonModel):
    """A GeoJSON polygon."""

    type: Annotated[Literal["Polygon"], Field(description="The GeoJSON type.")] = "Polygon"
    coordinates: Annotated[
        tuple[Ring, ...],
        Field(
            min_length=1,
            max_length=100,
            description="Closed rings of [longitude, latitude] in degrees: the outer ring first, "
            "then its holes.",
            examples=[[[[16.36, 48.2], [16.38, 48.2], [16.38, 48.21], [16.36, 48.2]]]],
        ),
    ]


@dataclass(frozen=True, slots=True)
class Closure:
    """What is closed in [from_ms, until_ms) of fleet time; without `until_ms` until it is lifted.

    It closes a station, one pad of the station, the segment from the station to `to_station_id`,
    or the area of a zone. A ground stop without a network holds everywhere; its area, provider
    and drone model limit it further.
    """

    closure_id: ClosureId
    kind: ClosureKind
    network_id: NetworkId | None
    from_ms: int
    made_ms: int
    until_ms: int | None = None
    lifted_ms: int | None = None
    station_id: StationId | None = None
    pad: int | None = None
    to_station_id: StationId | None = None
    area: Area | None = None
    provider_id: ProviderId | None = None
    drone_model_id: DroneModelId | None = None
    reason: str | None = None

    def lasts_beyond(self, moment_ms: int) -> bool:
        """Whether the closure ends after this moment, or never."""
        return self.until_ms is None or moment_ms < self.until_ms

    def is_in_force(self, at_ms: int) -> bool:
        """Whether the closure is in force at this moment."""
        return self.from_ms <= at_ms and self.lasts_beyond(at_ms)

    @property
    def zone(self) -> Zone | None:
        """Its area as a zone with the same times; None without an area."""
        if self.area is None:
            return None
        return Zone(
            zone_id=ZoneId(self.closure_id),
            rings=self.area.coordinates,
            active_from=ms_to_moment(self.from_ms),
            active_until=None if self.until_ms is None else ms_to_moment(self.until_ms),
        )


#: How the planning of a dry run ended.
ForeseenPlan = Literal["NEW_PLAN", "NO_PLAN", "NO_PLAN_YET", "NOT_NEEDED", "TIME_UP"]


class ForeseenDelay(JsonModel):
    """How much later the packages of a mission come, as planned for a dry run."""

    plan: Annotated[
        ForeseenPlan,
        Field(
            description="NEW_PLAN was found; NO_PLAN exists; NO_PLAN_YET can be made now; "
            "NOT_NEEDED; or TIME_UP before a plan was found."
        ),
    ]
    later_by_s: Annotated[
        float | None,
        Field(
            description="How much later the last package is delivered, seconds, negative if it is "
            "earlier; null if a package is not delivered."
        ),
    ]
    code: Annotated[
        str | None, Field(description="Why there is no plan, as a code; null if there is one.")
    ]
    detail: Annotated[str | None, Field(description="The same as a sentence.")]


class AffectedMission(JsonModel):
    """A mission that plans to land, charge, fly or take off where this is closed."""

    mission_id: Annotated[MissionId, Field(description="Id of the mission.")]
    drone_id: Annotated[DroneId, Field(description="Drone that flies the mission.")]
    provider_id: Annotated[ProviderId, Field(description="Provider of the drone.")]
    delivery_id: Annotated[DeliveryId, Field(description="Delivery that the mission carries.")]
    station_id: Annotated[
        StationId | None, Field(description="Station where the mission first meets the closure.")
    ]
    at: Annotated[
        datetime, Field(description="When the mission first meets the closure, fleet time.")
    ]
    is_flying: Annotated[bool, Field(description="Whether the drone is in the air now.")]
    delay: Annotated[
        ForeseenDelay | None,
        Field(
            description="What a dry run has planned for each of the first 20 missions; null for "
            "the others, and for a closure that is made."
        ),
    ] = None


@dataclass(frozen=True, slots=True)
class Reach:
    """A closure with the stations and segments of the network that it closes.

    No drone may land at `stations`. For a ground stop no drone may take off there, and None means
    everywhere. The pads of the stations in `pads_now_with` have only these connectors from now on.
    A drone may be `late_ms` late without a new plan. `what` names in words what is closed, for the
    case that a new version of the network has removed it.
    """

    closure: Closure
    stations: frozenset[StationId] | None = frozenset()
    segments: frozenset[SegmentEnds] = frozenset()
    late_ms: int = 0
    what: str | None = None
    pads_now_with: Mapping[StationId, frozenset[ConnectorId]] = field(default_factory=dict)


class WeatherOfModels(Protocol):
    """The weather of a network for each drone model."""

    def of_model(self, model: DroneModel) -> Weather:
        """The weather for drones of this model, by seconds of fleet time since 1970."""
        ...


class Impact(Protocol):
    """What a closure, or weather, does to the missions that are under way."""

    async def preview(self, db: Database, reach: Reach) -> tuple[AffectedMission, ...]:
        """The missions that the closure would affect, the earliest first."""
        ...

    async def foresee(self, db: Database, reach: Reach) -> tuple[AffectedMission, ...]:
        """As `preview`, with the delays of the first missions."""
        ...

    async def apply(self, tx: Tx, reach: Reach) -> tuple[AffectedMission, ...]:
        """Mark the missions that the closure affects for replanning, and return them."""
        ...

    async def retry(self, tx: Tx, network_id: NetworkId | None) -> None:
        """Plan again for missions that found no plan; None for those of all networks."""
        ...

    async def models_in_flight(self, db: Database, network_id: NetworkId) -> tuple[DroneModel, ...]:
        """The models of the drones that have missions in a network."""
        ...

    async def apply_weather(self, tx: Tx, network_id: NetworkId, weather: WeatherOfModels) -> int:
        """Mark the missions for replanning that would fly in a wind above their drones' limit.

        Returns how many they are.
        """
        ...
