"""A small town of five stations, 100 to 900 m apart, in a network that the gateway knows."""

from collections.abc import Mapping
from typing import Any

from skyway.announced_networks import CachedNetworks
from skyway.contracts.station_check import NetworkStations
from skyway.geo import Position, moved
from skyway.ids import NetworkId, StationId

#: Where the pickup's station stands.
SQUARE = Position(-97.9414, 29.8833)

#: Metres east of the square.
_EAST_M = {"san-marcos": 0.0, "mcqueeney": 5_000.0, "bulverde": 5_300.0, "san-antonio": 5_900.0}


def make_town(
    network_id: str = "town", east_m: Mapping[str, float] | None = None, **more_east_m: float
) -> NetworkStations:
    """Stations by how far east of the square they stand."""
    stations = {**(east_m or {}), **more_east_m} or _EAST_M
    return NetworkStations(
        network_id=NetworkId(network_id),
        version=1,
        station_ids=tuple(StationId(each) for each in stations),
        positions=tuple(moved(SQUARE, east_m=each, north_m=0.0) for each in stations.values()),
        parts=(0,) * len(stations),
        names={StationId("san-marcos"): "San Marcos", StationId("mcqueeney"): "Markt, Süd"},
    )


def make_house() -> NetworkStations:
    """Twenty stations in one house, 10 m from the square."""
    return make_town("house", {f"s{number:02}": 10.0 for number in range(20)})


def cached(*networks: NetworkStations) -> CachedNetworks:
    """These networks, or the town alone."""
    made = CachedNetworks()
    for each in networks or (make_town(),):
        made.put(each)
    return made


def location(*, east_m: float, north_m: float = 0.0) -> dict[str, Any]:
    """A location in a request's JSON, so far from the square."""
    at = moved(SQUARE, east_m=east_m, north_m=north_m)
    return {"location": {"latitude": at.latitude_deg, "longitude": at.longitude_deg}}
