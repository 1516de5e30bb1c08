"""The landing book on disk, for a start without the cloud."""

import logging
import os
from collections.abc import Iterable
from pathlib import Path

from pydantic import ValidationError

from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.json_model import WireModel
from skyway_drone_agent.analysis.landings import Landing
from skyway_drone_agent.landing_book.station_cache import CachedStation, StationCache
from skyway_drone_agent.landing_book.tiles import Tile

log = logging.getLogger(__name__)


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
