"""Stations, segments, zones, and the network that they form."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from skyway.errors import InvalidNetwork
from skyway.geo import Position
from skyway.ids import StationId, ZoneId


@dataclass(frozen=True, slots=True)
class Station:
    """A rooftop where drones take off and land; `pads` drones can recharge there at a time.

    `properties` are the GeoJSON properties that Skyway does not read, kept as they came.
    """

    station_id: StationId
    position: Position
    pads: int = 4
    name: str | None = None
    properties: Mapping[str, Any] = field(default_factory=dict)  # any JSON value, not ours


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

    `rings` are the polygon's rings as in GeoJSON: the outer one, then its holes.
    """

    zone_id: ZoneId
    rings: tuple[tuple[Position, ...], ...]
    active_from: datetime | None = None
    active_until: datetime | None = None
    properties: Mapping[str, Any] = field(default_factory=dict)  # any JSON value, not ours


@dataclass(frozen=True, slots=True)
class Network:
    """A skyway network; `settings` is read by the services only.

    Raises
    ------
    InvalidNetwork
        A segment names a station that is not there, or starts where it ends.
    """

    stations: Mapping[StationId, Station]
    segments: tuple[Segment, ...]
    zones: tuple[Zone, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)  # any JSON value, see the services
    _outgoing: Mapping[StationId, tuple[Segment, ...]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        outgoing: dict[StationId, list[Segment]] = {station: [] for station in self.stations}
        for number, segment in enumerate(self.segments):
            for end in (segment.from_id, segment.to_id):
                if end not in outgoing:
                    raise InvalidNetwork(f"segments.{number}", f"no station is called {end!r}")
            if segment.from_id == segment.to_id:
                raise InvalidNetwork(f"segments.{number}", f"starts where it ends: {end!r}")
            outgoing[segment.from_id].append(segment)
        frozen = {station: tuple(segments) for station, segments in outgoing.items()}
        object.__setattr__(self, "_outgoing", frozen)

    def segments_from(self, station_id: StationId) -> tuple[Segment, ...]:
        """The segments that leave this station, in the order of the document."""
        return self._outgoing[station_id]
