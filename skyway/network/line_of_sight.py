"""Which stations see each other, and the segments between them."""

from collections.abc import Iterable, Mapping
from itertools import chain

import numpy as np

from skyway.ids import StationId
from skyway.network.near_pairs import near_pairs
from skyway.network.network import Segment, Station, Zone
from skyway.network.zones import crosses


def segments_in_sight(
    stations: Mapping[StationId, Station], *, max_segment_m: float, zones: Iterable[Zone] = ()
) -> tuple[Segment, ...]:
    """The segments, in both directions, between stations that see each other.

    Two stations see each other when they are at most `max_segment_m` apart and the straight line
    between them crosses none of the zones, active or not.
    """
    zones = tuple(zones)
    in_order = list(stations.values())
    longitude_deg, latitude_deg = (
        np.array([station.position for station in in_order], np.float64).reshape(-1, 2).T
    )
    pairs = near_pairs(longitude_deg, latitude_deg, reach_m=max_segment_m)
    rows = zip(pairs.one.tolist(), pairs.other.tolist(), pairs.length_m.tolist(), strict=True)
    lines = ((in_order[one], in_order[other], length_m) for one, other, length_m in sorted(rows))
    return tuple(
        chain.from_iterable(
            (
                Segment(one.station_id, other.station_id, length_m),
                Segment(other.station_id, one.station_id, length_m),
            )
            for one, other, length_m in lines
            if not any(crosses(zone, one.position, other.position) for zone in zones)
        )
    )
