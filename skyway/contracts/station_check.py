"""Gateway and registry ask composition: do these stations exist, where, and are they connected."""

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
