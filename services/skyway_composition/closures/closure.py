"""Something of the world that is closed for a while: as it is kept, and as planning reads it."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from skyway.geo import Position
from skyway.ids import ClosureId, DroneModelId, NetworkId, ProviderId, StationId, ZoneId
from skyway.json_model import JsonModel
from skyway.network.network import Zone
from skyway.units import ms_to_moment

#: Nobody lands (STATION), charges (PAD), flies (SEGMENT, ZONE) or takes off (GROUND_STOP).
ClosureKind = Literal["STATION", "PAD", "SEGMENT", "ZONE", "GROUND_STOP"]


#: Positions of one ring; whoever draws a finer border simplifies it. Our own choice.
_MOST_POSITIONS = 10_000


def _closed(ring: tuple[Position, ...]) -> tuple[Position, ...]:
    if ring[0] != ring[-1]:
        raise PydanticCustomError("open_ring", "the ring is not closed: its ends differ")
    return ring


Ring = Annotated[
    tuple[Position, ...],
    Field(min_length=4, max_length=_MOST_POSITIONS),
    AfterValidator(_closed),
]


class Area(JsonModel):
    """A GeoJSON polygon: its closed rings, the outer one first, then its holes."""

    type: Literal["Polygon"] = "Polygon"
    coordinates: Annotated[tuple[Ring, ...], Field(min_length=1, max_length=100)]


@dataclass(frozen=True, slots=True)
class Closure:
    """What is closed in [from_ms, until_ms) of fleet time; without end until it is lifted.

    A station, a pad of it, the segment from it to `to_station_id`, or the area of a zone. A ground
    stop without network is everywhere; its area, provider and drone model narrow it down.
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
        """Whether some of its time lies after this moment."""
        return self.until_ms is None or moment_ms < self.until_ms

    def is_in_force(self, at_ms: int) -> bool:
        """Whether this moment lies in its time."""
        return self.from_ms <= at_ms and self.lasts_beyond(at_ms)

    @property
    def zone(self) -> Zone | None:
        """Its area as a zone with its times; None without area."""
        if self.area is None:
            return None
        return Zone(
            zone_id=ZoneId(self.closure_id),
            rings=self.area.coordinates,
            active_from=ms_to_moment(self.from_ms),
            active_until=None if self.until_ms is None else ms_to_moment(self.until_ms),
        )
