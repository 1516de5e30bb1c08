"""The lengths of shortest ways, and of those that end early, against Bellman and Ford's method."""

import numpy as np
import numpy.typing as npt
import pytest

from skyway.network.network import Network
from skyway.network.synthetic import synthetic_city
from skyway.planner.kernels.ways import lengths_from

_ROOT = 3


@pytest.fixture(scope="module")
def city() -> Network:
    return synthetic_city(stations=80, seed=2, pads=1)


def true_m(network: Network) -> npt.NDArray[np.float64]:
    """The shortest ways from the root: each segment is tried until none shortens one."""
    columns = network.columns
    least = np.full(len(network.row_of), np.inf)
    least[_ROOT] = 0.0
    for _ in network.row_of:
        np.minimum.at(least, columns.to_row, least[columns.from_row] + columns.length_m)
    return least


def found_m(network: Network, *, most_settled: int) -> npt.NDArray[np.float64]:
    away, rows = network.outgoing, np.arange(len(network.row_of))
    return lengths_from(away.offsets, away.station, away.length_m, _ROOT, rows, most_settled)


def test_every_length_is_that_of_the_shortest_path(city: Network) -> None:
    assert found_m(city, most_settled=80) == pytest.approx(true_m(city))


def test_a_search_that_ends_early_gives_the_nearest_and_a_bound_for_the_others(
    city: Network,
) -> None:
    in_order = np.sort(true_m(city))

    found = np.sort(found_m(city, most_settled=20))

    assert found[:20] == pytest.approx(in_order[:20])
    assert found[20:] == pytest.approx(in_order[20])


def test_without_a_path_the_length_is_infinite(city: Network) -> None:
    no_offsets = np.zeros(81, np.int64)
    nothing = np.empty(0)

    lengths = lengths_from(
        no_offsets, nothing.astype(np.int32), nothing, _ROOT, np.array([3, 4]), 80
    )

    assert lengths.tolist() == [0.0, np.inf]
