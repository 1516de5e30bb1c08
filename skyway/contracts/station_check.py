"""Gateway and registry ask composition: which stations exist, where, and are they connected."""

from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.json_model import WireModel


class StationCheckQuery(WireModel):
    """Stations to look up; with `reachable_from`, also whether a path leads to each of them."""

    station_ids: tuple[StationId, ...]
    reachable_from: StationId | None = None


class StationCheck(WireModel):
    """What is known of the stations asked for.

    `network_ids` and `positions` hold the known ones; `unreachable` are known, but no path leads
    there from `reachable_from` (another network counts as unreachable too).
    """

    network_ids: dict[StationId, NetworkId]
    positions: dict[StationId, Position]
    unknown: tuple[StationId, ...]
    unreachable: tuple[StationId, ...] = ()


class NetworkStations(WireModel):
    """All stations of a network's current version, a place in the lists for each.

    From a station a path leads to all others of the same part; to other parts it may or may not.
    A network too large to be told at once is told without any.
    """

    network_id: NetworkId
    version: int
    station_ids: tuple[StationId, ...] = ()
    positions: tuple[Position, ...] = ()
    parts: tuple[int, ...] = ()
