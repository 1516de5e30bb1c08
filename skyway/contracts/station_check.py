"""The gateway and the registry ask composition which stations exist, where, and how connected."""

from typing import Annotated

from pydantic import Field

from skyway.geo import Position
from skyway.ids import ConnectorId, NetworkId, StationId
from skyway.json_model import WireModel


class StationCheckQuery(WireModel):
    """Stations to look up; with `reachable_from`, also whether a path leads to each of them.

    With `as_homes` the answer also says what drones with these homes meet.
    """

    station_ids: Annotated[tuple[StationId, ...], Field(description="The stations to look up.")]
    reachable_from: StationId | None = None
    as_homes: bool = False


class NetworkFacts(WireModel):
    """What drones meet in a network; `connectors` is null where some pad fits every drone."""

    currency: Annotated[str, Field(description="Currency of all prices in the network.")]
    connectors: Annotated[
        tuple[ConnectorId, ...] | None, Field(description="All connectors of its pads.")
    ]
    price_ceiling: Annotated[
        int | None,
        Field(description="The most that a booking without `max_price` costs; null: no limit."),
    ] = None


class StationCheck(WireModel):
    """The answer about the requested stations.

    `network_ids` and `positions` hold the stations that exist. `unreachable` stations exist, but no
    path leads there from `reachable_from` (stations of another network are unreachable too).
    `isolated` and `networks` are filled for homes only.
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
    closed: Annotated[
        tuple[StationId, ...], Field(description="The stations that a closure forbids now.")
    ] = ()
    isolated: Annotated[
        tuple[StationId, ...], Field(description="The stations that no segment leaves.")
    ] = ()
    networks: Annotated[
        dict[NetworkId, NetworkFacts],
        Field(description="The networks of the stations that exist."),
    ] = Field(default_factory=dict)


class NetworkStations(WireModel):
    """All stations of a network's current version; each list has one entry for each station.

    A path leads from each station to all others of the same part; to other parts there may be none.
    The lists are empty if the network is too large for one answer.
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
    names: Annotated[
        dict[StationId, str], Field(description="The name for people of each station with one.")
    ] = Field(default_factory=dict)
    loading_s: Annotated[
        float, Field(ge=0, description="How long loading takes in the network, seconds.")
    ] = 0.0
    dropoff_s: Annotated[
        float, Field(ge=0, description="How long a hand-over takes in the network, seconds.")
    ] = 0.0
    proof_s: Annotated[
        float,
        Field(ge=0, description="How much longer it takes if the request needs a proof, seconds."),
    ] = 0.0
