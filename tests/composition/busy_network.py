"""The stations of a busy world, and the model of its drones."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

from skyway_composition.networks.publish import read_content
from skyway_composition.networks.station_store import replace_stations
from skyway_composition.networks.store import VersionRow, add_version

from skyway.drone.models import DRONE_MODELS
from skyway.geo import Position
from skyway.ids import DroneModelId, NetworkId
from skyway.runtime.sql.database import Tx

NETWORK_ID = NetworkId("hot")

#: Three stations, 12 km from each other, with a pad each.
PLACES = {"a": Position(0.0, 0.0), "b": Position(0.1079, 0.0), "c": Position(0.05395, 0.0934)}

#: A drone that can fly two of the three segments with one charge.
MODEL = DRONE_MODELS[DroneModelId("paper-scenario")].model_copy(
    update={"reserve_soc": 0.05, "stop_s": 30.0, "stop_j": 4_000.0}
)


#: All of them are connected with each other, in both directions.
SEGMENTS = ("ab", "bc", "ca")


def network_of(places: Mapping[str, Position], segments: Iterable[str]) -> dict[str, Any]:
    """Stations with a pad each at these places; each segment names its two ends."""
    points = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": list(position)},
            "properties": {"kind": "station", "station_id": name, "pads": 1},
        }
        for name, position in places.items()
    ]
    lines = [
        {
            "type": "Feature",
            "geometry": {
                "type": "LineString",
                "coordinates": [list(places[start]), list(places[end])],
            },
            "properties": {"kind": "segment", "from": start, "to": end},
        }
        for start, end in ((each[0], each[1]) for each in segments)
    ]
    return {"type": "FeatureCollection", "features": points + lines}


async def add_network(
    tx: Tx,
    *,
    now_ms: int,
    places: Mapping[str, Position] = PLACES,
    segments: Iterable[str] = SEGMENTS,
    version: int = 1,
    settings: Mapping[str, Any] = MappingProxyType({}),
) -> None:
    """Add a network as a version of `NETWORK_ID`."""
    content = await read_content({**network_of(places, segments), "settings": {**settings}})
    row = VersionRow(NETWORK_ID, version, content.sha256, now_ms)
    await add_version(tx, row, content=content.geojson)
    await replace_stations(tx, NETWORK_ID, content.network.stations.values())
