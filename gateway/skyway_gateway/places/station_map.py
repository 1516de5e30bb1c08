"""The stations of the known networks on a map: which of them lie near a position."""

from bisect import bisect_left, bisect_right
from collections import Counter
from math import cos, radians
from typing import Annotated, Final, NamedTuple

from pydantic import Field

from skyway.announced_networks import CachedNetworks, KnownStation
from skyway.geo import EARTH_RADIUS_M, Position, distance_m, unit_vector, wrapped_deg
from skyway.ids import NetworkId, StationId
from skyway.json_model import JsonModel

#: The stations of one area that are considered for a place, the nearest ones: so twenty stations in
#: one house cost what four cost.
MOST_NEAR: Final = 4

#: A connected part of a network.
Area = tuple[NetworkId, int]


class Walk(NamedTuple):
    """A station and how far it is, metres in a straight line."""

    walk_m: float
    station: KnownStation


class NearStation(JsonModel):
    """A station near a place."""

    station_id: StationId
    name: Annotated[str | None, Field(description="Name of the station for people.")] = None
    walk_m: Annotated[
        float,
        Field(
            description="Metres from the place in a straight line. The way on foot is often longer "
            "by a third."
        ),
    ]

    @classmethod
    def of(cls, walk: Walk) -> "NearStation":
        """The station of a walk, as customers see it."""
        station_id, name = walk.station.station_id, walk.station.name
        return cls(station_id=station_id, name=name, walk_m=round(walk.walk_m, 1))


class StationMap:
    """The stations of all cached networks, sorted by latitude; sorted anew when networks change."""

    def __init__(self, networks: CachedNetworks) -> None:
        self._networks = networks
        self._revision = -1
        self._stations: list[KnownStation] = []
        self._latitudes: list[float] = []
        self._by_id: dict[StationId, KnownStation] = {}

    @property
    def revision(self) -> int:
        """Grows with each change of the cached networks."""
        return self._networks.revision

    @property
    def stations(self) -> list[KnownStation]:
        """All stations, those in the south first."""
        if self._revision != self._networks.revision:
            self._revision = self._networks.revision
            self._stations = sorted(
                self._networks.stations(), key=lambda each: each.position.latitude_deg
            )
            self._latitudes = [each.position.latitude_deg for each in self._stations]
            self._by_id = {each.station_id: each for each in self._stations}
        return self._stations

    @property
    def by_id(self) -> dict[StationId, KnownStation]:
        """All stations by their ids."""
        return self._by_id if self.stations else {}

    def near(self, position: Position, *, within_m: float) -> list[Walk]:
        """The nearest stations of each area, at most four of an area; ties are broken by id."""
        stations, reach_deg = self.stations, within_m / _DEGREE_M
        south = bisect_left(self._latitudes, position.latitude_deg - reach_deg)
        north = bisect_right(self._latitudes, position.latitude_deg + reach_deg)
        # Near a pole a degree of longitude is short; then each longitude is compared.
        narrowest = cos(radians(min(abs(position.latitude_deg) + reach_deg, 90.0)))
        reach_east_deg = reach_deg / narrowest if narrowest > reach_deg / 180.0 else 180.0
        walks = (
            Walk(distance_m(position, each.position), each)
            for each in stations[south:north]
            if abs(wrapped_deg(each.position.longitude_deg - position.longitude_deg))
            <= reach_east_deg
        )
        seen: Counter[Area] = Counter()
        near: list[Walk] = []
        for walk in sorted(walks, key=_rank):
            seen[walk.station.area] += 1
            if walk.walk_m <= within_m and seen[walk.station.area] <= MOST_NEAR:
                near.append(walk)
        return near

    def nearest(self, position: Position) -> Walk | None:
        """The nearest station of all networks; None if no station is known."""
        x, y, z = unit_vector(position)

        def closeness(station: KnownStation) -> float:
            east, north, up = unit_vector(station.position)
            return x * east + y * north + z * up

        found = max(self.stations, key=closeness, default=None)
        return None if found is None else Walk(distance_m(position, found.position), found)


#: The length of a degree of latitude, a little short, so that rounding loses no station.
_DEGREE_M: Final = EARTH_RADIUS_M * radians(1.0) * (1 - 1e-9)


def _rank(walk: Walk) -> tuple[float, StationId]:
    return walk.walk_m, walk.station.station_id
