"""Which stations are connected."""

import numpy as np
import numpy.typing as npt

from skyway.ids import StationId
from skyway.network.columns import segment_keys
from skyway.network.network import Network
from skyway.network.nx import to_networkx

Indices = npt.NDArray[np.int64]


def components(one: Indices, other: Indices, *, stations: int) -> Indices:
    """The smallest row of each station's component, ``(n,)``; lines join both ways.

    The smallest row of a component is the root of a tree. A root with a smaller neighbour is put
    below that neighbour, then the trees are flattened, until no line joins two trees. This takes
    about log n rounds.
    """
    root = np.arange(stations)
    while True:
        root_one, root_other = root[one], root[other]
        is_apart = root_one != root_other
        if not is_apart.any():
            return root
        one, other = one[is_apart], other[is_apart]
        root_one, root_other = root_one[is_apart], root_other[is_apart]
        np.minimum.at(root, np.maximum(root_one, root_other), np.minimum(root_one, root_other))
        while not np.array_equal(root, flatter := root[root]):
            root = flatter


def station_parts(network: Network) -> Indices:
    """The part of each station, ``(n,)``; within a part, paths lead from each station to each."""
    columns, stations = network.columns, len(network.columns.station_ids)
    forth = segment_keys(columns.from_row, columns.to_row, stations=stations)
    back = segment_keys(columns.to_row, columns.from_row, stations=stations)
    if np.array_equal(np.sort(forth), np.sort(back)):
        one, other = columns.from_row.astype(np.int64), columns.to_row.astype(np.int64)
        return components(one, other, stations=stations)
    from networkx import strongly_connected_components

    parts = np.empty(stations, dtype=np.int64)
    for part in strongly_connected_components(to_networkx(network)):
        rows = [network.row_of[StationId(station_id)] for station_id in part]
        parts[rows] = min(rows)
    return parts


def component_sizes(network: Network) -> list[int]:
    """How many stations each part has; within a part, paths lead from each station to each."""
    return [size for size in np.bincount(station_parts(network)).tolist() if size]
