"""The network that comes with Skyway: the paper's corridor from San Marcos to San Antonio, Texas.

Places are GeoNames', airports airportsdata's; both lie in `data/`, with their licences.
"""

import math
from collections.abc import Iterable, Mapping
from typing import Any

from skyway.geo import EARTH_RADIUS_M, Position, distance_m
from skyway.ids import StationId, ZoneId
from skyway.network.gazetteer import bundled_extract
from skyway.network.near_pairs import segments_in_sight
from skyway.network.network import DEFAULT_PADS, Network, Station, Zone

#: Radius of the no-fly disc around an airport, metres. Our own simplification: real controlled
#: airspace differs from airport to airport and with height.
AIRPORT_DISC_RADIUS_M = 2_000.0

#: A disc reaches at most this share of the distance to the nearest station, so no station stands
#: in a disc or is enclosed by one. Bulverde Airpark lies 525 m from Bulverde. Our own choice.
_NEAREST_STATION_SHARE = 0.5

_DISC_CORNERS = 24


def texas_corridor(*, max_segment_m: float = 20_000.0) -> Network:
    """The 56 places of the corridor, with segments up to a line of sight and a disc per airport.

    Every station has 4 pads. No segment crosses an airport's disc. The paper's four towns are
    connected from about 18 km up; at 20 km 6 of the 56 stations are not connected to them.

    Parameters
    ----------
    max_segment_m
        The longest line of sight.
    """
    extract = bundled_extract()
    stations = {station.station_id: station for station in map(_station, extract["places"])}
    zones = tuple(_disc(airport, stations.values()) for airport in extract["airports"])
    segments = segments_in_sight(stations, max_segment_m=max_segment_m, zones=zones)
    return Network(stations, segments, zones)


def _station(place: Mapping[str, Any]) -> Station:
    return Station(
        station_id=StationId(place["station_id"]),
        position=Position(place["longitude_deg"], place["latitude_deg"]),
        pads=DEFAULT_PADS,
        name=place["name"],
        properties={"geonameid": place["geonameid"]},
    )


def _disc(airport: Mapping[str, Any], stations: Iterable[Station]) -> Zone:
    """The zone around an airport: a regular polygon, its corners on the disc's edge."""
    centre = Position(airport["longitude_deg"], airport["latitude_deg"])
    nearest_m = min(distance_m(centre, station.position) for station in stations)
    radius_m = min(AIRPORT_DISC_RADIUS_M, _NEAREST_STATION_SHARE * nearest_m)
    north_deg = math.degrees(radius_m / EARTH_RADIUS_M)
    east_deg = north_deg / math.cos(math.radians(centre.latitude_deg))
    angles = (2 * math.pi * corner / _DISC_CORNERS for corner in range(_DISC_CORNERS))
    corners = [
        Position(
            # Seven digits are a centimetre.
            round(centre.longitude_deg + east_deg * math.cos(angle), 7),
            round(centre.latitude_deg + north_deg * math.sin(angle), 7),
        )
        for angle in angles
    ]
    return Zone(
        zone_id=ZoneId(f"airport-{airport['code'].lower()}"),
        rings=((*corners, corners[0]),),
        properties={"name": airport["name"], "radius_m": round(radius_m)},
    )
