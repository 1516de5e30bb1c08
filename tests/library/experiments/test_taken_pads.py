from collections import defaultdict
from itertools import pairwise

import numpy as np
import pytest

from skyway.experiments.taken_pads import taken_book, taken_pads
from skyway.network.synthetic import synthetic_city
from skyway.planner.problem_parts import PadReservation

HORIZON_S = 400_000.0
CITY = synthetic_city(stations=8, seed=1)


def end_s(held: PadReservation) -> float:
    assert held.end_s is not None
    return held.end_s


@pytest.mark.parametrize("share", [0.3, 0.8, 0.95])
def test_the_share_of_the_pads_time_is_taken(share):
    reserved_s = sum(
        min(end_s(held), HORIZON_S) - max(held.start_s, 0.0)
        for held in taken_pads(CITY, share=share, seed=1, horizon_s=HORIZON_S)
    )

    assert reserved_s / (8 * 4 * HORIZON_S) == pytest.approx(share, abs=0.03)


@pytest.mark.parametrize("share", [0.3, 0.8, 0.95])
def test_the_share_is_taken_in_a_pad_book_too(share):
    book = taken_book(CITY, np.arange(8), share=share, seed=1, horizon_s=HORIZON_S)
    starts_s = np.maximum(book.start_ms / 1000, 0.0)
    ends_s = np.minimum(book.end_ms / 1000, HORIZON_S)

    taken_s = np.maximum(ends_s - starts_s, 0.0).sum()
    assert taken_s / (8 * 4 * HORIZON_S) == pytest.approx(share, abs=0.03)


def test_no_two_sessions_of_a_pad_overlap():
    by_pad = defaultdict(list)
    for held in taken_pads(CITY, share=0.9, seed=1):
        by_pad[held.station_id, held.pad].append((held.start_s, end_s(held)))

    assert len(by_pad) == 8 * 4
    for sessions in by_pad.values():
        assert all(start_s >= last_s for (_, last_s), (start_s, _) in pairwise(sessions))


def test_the_same_seed_takes_the_same_pads():
    assert taken_pads(CITY, share=0.5, seed=1) == taken_pads(CITY, share=0.5, seed=1)
    assert taken_pads(CITY, share=0.5, seed=1) != taken_pads(CITY, share=0.5, seed=2)


def test_at_share_0_no_pad_is_reserved():
    assert taken_pads(CITY, share=0.0, seed=1) == ()
