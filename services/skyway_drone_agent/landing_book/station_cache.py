"""The stations that were read from the cloud, by tiles: the search for near ones, and the file."""

import logging
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from skyway.contracts.flight_step import FlyStep
from skyway.geo import Position, distance_m, point_between
from skyway.ids import NetworkId, StationId
from skyway.json_model import WireModel
from skyway_drone_agent.analysis.landings import Landing
from skyway_drone_agent.landing_book.tiles import Tile, covered_m, ring, tile_of

log = logging.getLogger(__name__)

#: Limits of the cache; the tiles that were read longest ago are dropped first.
MOST_STATIONS: Final = 20_000
MOST_TILES: Final = 20_000

#: Stations are searched up to this many tiles away.
_FURTHEST: Final = 4

#: Number of places along a flight, its ends included, and landings near each place.
_PLACES: Final = 8
_LANDINGS: Final = 4


@dataclass(frozen=True, slots=True)
class CachedStation:
    """A station of a network; a closed station is no landing."""

    network_id: NetworkId
    landing: Landing
    is_closed: bool = False


@dataclass(frozen=True, slots=True)
class CachedTile:
    """The stations of a tile, and when they were read, by this process's monotonic clock."""

    stations: tuple[CachedStation, ...]
    at_s: float


class StationCache:
    """The stations of the tiles read so far, the newest tiles at the end."""

    def __init__(self, *, most_stations: int = MOST_STATIONS, most_tiles: int = MOST_TILES) -> None:
        self._most_stations = most_stations
        self._most_tiles = most_tiles
        self._tiles: dict[tuple[NetworkId, Tile], CachedTile] = {}
        self._networks: dict[NetworkId, int] = {}
        self._stations = 0

    def __iter__(self) -> Iterator[tuple[NetworkId, Tile, tuple[CachedStation, ...]]]:
        """All tiles with their stations, the oldest first."""
        for (network_id, tile), cached in self._tiles.items():
            yield network_id, tile, cached.stations

    def read_at_s(self, network_id: NetworkId, tile: Tile) -> float:
        """When the tile was read; minus infinity if it is not in the cache."""
        cached = self._tiles.get((network_id, tile))
        return float("-inf") if cached is None else cached.at_s

    def put(
        self,
        network_id: NetworkId,
        tiles: Iterable[Tile],
        found: Iterable[CachedStation],
        *,
        at_s: float,
    ) -> None:
        """Replace the stations in these tiles."""
        by_tile: dict[Tile, list[CachedStation]] = {tile: [] for tile in tiles}
        for station in found:
            # Stations outside the tiles are skipped: their tiles are read separately.
            by_tile.get(tile_of(station.landing.position), []).append(station)
        for tile, stations in by_tile.items():
            self._drop((network_id, tile))
            self._tiles[network_id, tile] = CachedTile(tuple(stations), at_s)
            self._networks[network_id] = self._networks.get(network_id, 0) + 1
            self._stations += len(stations)
        while self._stations > self._most_stations or len(self._tiles) > self._most_tiles:
            self._drop(next(iter(self._tiles)))

    def nearest(self, here: Position, *, count: int) -> list[CachedStation]:
        """The nearest open stations of all networks, up to about 20 km away, nearest first."""

        def far(station: CachedStation) -> tuple[float, StationId]:
            landing = station.landing
            return distance_m(here, landing.position), landing.station_id

        found: list[tuple[tuple[float, StationId], CachedStation]] = []
        for distance in range(_FURTHEST + 1):
            for tile in ring(here, distance):
                found += [(far(one), one) for one in self._in(tile) if not one.is_closed]
            found.sort(key=itemgetter(0))
            del found[count:]
            if len(found) == count and found[-1][0][0] <= covered_m(here, distance):
                break
        return [station for _, station in found]

    def station(self, landing: Landing) -> CachedStation | None:
        """The cached station at this landing; None if it is not in the cache."""
        for station in self._in(tile_of(landing.position)):
            if station.landing.station_id == landing.station_id:
                return station
        return None

    def _in(self, tile: Tile) -> Iterator[CachedStation]:
        for network_id in self._networks:
            cached = self._tiles.get((network_id, tile))
            if cached is not None:
                yield from cached.stations

    def _drop(self, key: tuple[NetworkId, Tile]) -> None:
        cached = self._tiles.pop(key, None)
        if cached is None:
            return
        self._stations -= len(cached.stations)
        self._networks[key[0]] -= 1
        if not self._networks[key[0]]:
            del self._networks[key[0]]


class Surroundings:
    """The cached stations around a flight; `edition` changes when they were read again."""

    __slots__ = ("_cache", "edition")

    def __init__(self, cache: StationCache) -> None:
        self.edition = 0
        self._cache = cache

    def landings_along(self, flight: FlyStep) -> tuple[Landing, ...]:
        """The open stations of this flight's network that are nearest to places along it."""
        start, end = flight.from_position, flight.to_position
        station = self._cache.station(Landing(flight.to_id, end)) or self._cache.station(
            Landing(flight.from_id, start)
        )
        if station is None:
            return ()
        found: dict[Landing, None] = {}
        for place in range(_PLACES):
            here = point_between(start, end, fraction=place / (_PLACES - 1))
            for one in self._cache.nearest(here, count=_LANDINGS):
                if one.network_id == station.network_id:
                    found[one.landing] = None
        return tuple(found)

    def is_closed(self, landing: Landing) -> bool:
        """Whether this station was closed when its surroundings were read."""
        station = self._cache.station(landing)
        return station is not None and station.is_closed


class _KeptTile(WireModel):
    network_id: NetworkId
    tile: Tile
    stations: tuple[tuple[StationId, Position, bool], ...]


class _Kept(WireModel):
    tiles: tuple[_KeptTile, ...]


class StationCacheFile:
    """Reads and replaces the file. Errors are logged: the agent also works without the file."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def read(self) -> StationCache:
        """The cache in the file; empty if there is no readable file."""
        cache = StationCache()
        try:
            kept = _Kept.read(self._path.read_bytes())
        except FileNotFoundError:
            return cache
        except (OSError, ValidationError) as error:
            log.warning("landing book not read", extra={"error": type(error).__name__})
            return cache
        for one in kept.tiles:
            cache.put(
                one.network_id,
                [one.tile],
                (
                    CachedStation(one.network_id, Landing(station_id, position), is_closed)
                    for station_id, position, is_closed in one.stations
                ),
                # These stations may be used, but must be read again.
                at_s=float("-inf"),
            )
        return cache

    def write(self, tiles: Iterable[tuple[NetworkId, Tile, tuple[CachedStation, ...]]]) -> None:
        """Replace the file, all or nothing."""
        text = _Kept(tiles=tuple(_kept(*one) for one in tiles)).model_dump_json()
        # The process id is in the name: agents of other drones may share the folder.
        draft = self._path.with_suffix(f".{os.getpid()}")
        try:
            with draft.open("w") as output:
                output.write(text)
                output.flush()
                os.fsync(output.fileno())
            draft.replace(self._path)
        except OSError as error:
            # A full disk: only a start without the cloud needs the file.
            log.warning("landing book not kept", extra={"error": str(error)})


def _kept(network_id: NetworkId, tile: Tile, stations: tuple[CachedStation, ...]) -> _KeptTile:
    return _KeptTile(
        network_id=network_id,
        tile=tile,
        stations=tuple(
            (each.landing.station_id, each.landing.position, each.is_closed) for each in stations
        ),
    )
