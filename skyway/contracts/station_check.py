"""Gateway and registry ask composition: which stations exist, where, and are they connected."""

from typing import Annotated

from pydantic import Field

from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.json_model import WireModel


class StationCheckQuery(WireModel):
    """Stations to look up; with `reachable_from`, also whether a path leads to each of them."""

    station_ids: Annotated[tuple[StationId, ...], Field(description="The stations to look up.")]
    reachable_from: StationId | None = None


class StationCheck(WireModel):
    """What is known of the stations asked for.

    `network_ids` and `positions` hold the known ones; `unreachable` are known, but no path leads
    there from `reachable_from` (another network counts as unreachable too).
    """

    network_ids: Annotated[
        dict[StationId, NetworkId], Field(description="The network of each station that exists.")
    ]
    positions: Annotated[
        dict[StationId, Position],
        Field(description="Where each station that exists is, in degrees."),
    ]
    unknown: Annotated[tuple[StationId, ...], Field(description="The stations that do not exist.")]
    unreachable: Annotated[
        tuple[StationId, ...], Field(description="The stations to which no path leads.")
    ] = ()


class NetworkStations(WireModel):
    """All stations of a network's current version, a place in the lists for each.

    From a station a path leads to all others of the same part; to other parts it may or may not.
    A network too large to be told at once is told without any.
    """

    network_id: NetworkId
    version: Annotated[int, Field(description="The current version of the network.")]
    station_ids: Annotated[
        tuple[StationId, ...], Field(description="The station of each row.")
    ] = ()
    positions: Annotated[
        tuple[Position, ...], Field(description="Where the station of each row is, in degrees.")
    ] = ()
    parts: Annotated[tuple[int, ...], Field(description="The connected part of each row.")] = ()
    loading_s: Annotated[
        float, Field(ge=0, description="How long loading takes in the network, seconds.")
    ] = 0.0
    dropoff_s: Annotated[
        float, Field(ge=0, description="How long a hand-over takes in the network, seconds.")
    ] = 0.0
