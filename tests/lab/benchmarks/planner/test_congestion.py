"""Reservations of other drones, drawn at random."""

import numpy as np
import pytest
from skyway_lab.benchmarks.planner.congestion import Congestion, book

from skyway.network.network import Network
from skyway.network.synthetic import synthetic_city
from skyway.planner.pad_book import PadBook

DAY_S = 86_400.0


@pytest.fixture(scope="module")
def network() -> Network:
    return synthetic_city(stations=300, seed=1)


def held_share(pads: PadBook, moment_s: float, *, pads_in_all: int) -> float:
    held = (pads.start_ms <= 1000 * moment_s) & (pads.end_ms > 1000 * moment_s)
    return float(held.sum()) / pads_in_all


@pytest.mark.parametrize("taken", [0.5, 0.7, 0.85])
@pytest.mark.parametrize("moment_s", [0.0, DAY_S / 2, DAY_S - 1])
def test_the_share_asked_for_is_held_at_any_moment(
    network: Network, taken: float, moment_s: float
) -> None:
    pads = book(network, Congestion(taken, DAY_S), sources=[0])

    assert held_share(pads, moment_s, pads_in_all=1_200) == pytest.approx(taken, abs=0.05)


def test_reservations_of_a_pad_follow_one_another_in_the_books_order(network: Network) -> None:
    pads = book(network, Congestion(0.7, DAY_S), sources=[0])

    order = np.lexsort((pads.start_ms, pads.pad, pads.station))
    is_same_pad = (np.diff(pads.station) == 0) & (np.diff(pads.pad) == 0)
    assert (order == np.arange(order.size)).all()
    assert (pads.start_ms < pads.end_ms).all()
    assert (pads.start_ms[1:][is_same_pad] >= pads.end_ms[:-1][is_same_pad]).all()


def test_nothing_is_reserved_when_nothing_is_taken(network: Network) -> None:
    pads = book(network, Congestion(0.0, DAY_S), sources=[0])

    assert pads.station.size == 0
