"""Which stations see each other: pairs up to a distance, and the segments between them."""

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain, product

from skyway.geo import EARTH_RADIUS_M, Position, distance_m, unit_vector
from skyway.ids import StationId
from skyway.network.network import Segment, Station, Zone
from skyway.network.zones import crosses

_HALF_EARTH_M = math.pi * EARTH_RADIUS_M
_CELLS_AROUND = tuple(product((-1, 0, 1), repeat=3))


def segments_in_sight(
    stations: Mapping[StationId, Station], *, max_segment_m: float, zones: Iterable[Zone] = ()
) -> tuple[Segment, ...]:
    """The segments, in both directions, between stations that see each other.

    Two stations see each other when they are at most `max_segment_m` apart and the straight line
    between them crosses none of the zones, active or not.
    """
    zones = tuple(zones)
    in_order = list(stations.values())
    pairs = pairs_within([station.position for station in in_order], reach_m=max_segment_m)
    return both_ways(
        (in_order[a], in_order[b], length_m)
        for length_m, a, b in sorted(pairs, key=lambda pair: pair[1:])
        if not any(crosses(zone, in_order[a].position, in_order[b].position) for zone in zones)
    )


def both_ways(lines: Iterable[tuple[Station, Station, float]]) -> tuple[Segment, ...]:
    """Two opposite segments for each line of two stations and a length in metres."""
    return tuple(
        chain.from_iterable(
            (
                Segment(one.station_id, other.station_id, length_m),
                Segment(other.station_id, one.station_id, length_m),
            )
            for one, other, length_m in lines
        )
    )


def pairs_within(positions: Sequence[Position], *, reach_m: float) -> list[tuple[float, int, int]]:
    """All pairs at most `reach_m` apart, as (distance in metres, index, greater index).

    Only near positions are compared: each falls into a cell of space, and the positions that it
    reaches lie in its own cell or the 26 around it. Cells of space have no pole and no seam.
    """
    if reach_m <= 0.0:
        return []
    # A shade wider than the chord, so that rounding never loses a pair at the limit.
    width = 2 * math.sin(min(reach_m, _HALF_EARTH_M) / (2 * EARTH_RADIUS_M)) * (1 + 1e-9) + 1e-12
    vectors = [unit_vector(position) for position in positions]
    cells: dict[tuple[int, int, int], list[int]] = {}
    pairs = []
    for number, (x, y, z) in enumerate(vectors):
        i, j, k = math.floor(x / width), math.floor(y / width), math.floor(z / width)
        for step_i, step_j, step_k in _CELLS_AROUND:
            for earlier in cells.get((i + step_i, j + step_j, k + step_k), ()):
                other_x, other_y, other_z = vectors[earlier]
                chord_squared = (x - other_x) ** 2 + (y - other_y) ** 2 + (z - other_z) ** 2
                if chord_squared > width * width:
                    continue
                apart_m = distance_m(positions[earlier], positions[number])
                if apart_m <= reach_m:
                    pairs.append((apart_m, earlier, number))
        cells.setdefault((i, j, k), []).append(number)
    return pairs
