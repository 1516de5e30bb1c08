"""What a network is made of: stations, segments, zones."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from skyway.geo import Position
from skyway.ids import StationId, ZoneId

#: Pads of a station that does not say how many it has (Shahzaad and Bouguettaya, section V).
DEFAULT_PADS = 4

#: Most pads of one station; a calendar is kept for each. Our own choice.
MAX_PADS = 1_000


@dataclass(frozen=True, slots=True)
class Station:
    """A rooftop where drones take off and land; `pads` drones can recharge there at a time.

    Idle drones may gather at a parking station, which has at least one pad. `properties` are the
    GeoJSON properties that Skyway does not read, kept as they came.
    """

    station_id: StationId
    position: Position
    pads: int = DEFAULT_PADS
    name: str | None = None
    properties: Mapping[str, Any] = field(default_factory=dict)  # any JSON value, not ours
    is_parking: bool = False


@dataclass(frozen=True, slots=True)
class Segment:
    """A line of sight that drones fly from one station to another, in this direction only."""

    from_id: StationId
    to_id: StationId
    length_m: float
    properties: Mapping[str, Any] = field(default_factory=dict)  # any JSON value, not ours


@dataclass(frozen=True, slots=True)
class Zone:
    """An area closed to flight while active: [active_from, active_until), a missing bound is open.

    `rings` are the polygon's rings as in GeoJSON, each closed: the outer one, then its holes. Each
    edge goes the shorter way round the Earth, and a ring around a pole holds the nearer pole.
    """

    zone_id: ZoneId
    rings: tuple[tuple[Position, ...], ...]
    active_from: datetime | None = None
    active_until: datetime | None = None
    properties: Mapping[str, Any] = field(default_factory=dict)  # any JSON value, not ours
