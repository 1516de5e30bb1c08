"""When to leave around closures, compared with trying every quarter of a second."""

from types import SimpleNamespace

import numpy as np
import pytest

from skyway.planner.kernels.records import Closed

_SEGMENT, _LANDING = 3, 7
_STEP_S = 0.25


@pytest.mark.parametrize("seed", range(40))
def test_the_first_and_last_moments_to_leave_equal_those_found_by_trying(
    plain: SimpleNamespace, seed: int
) -> None:
    random = np.random.default_rng(seed)
    closed = _closed(plain, random)
    flight_s, stop_s = float(random.integers(1, 9)), float(random.integers(0, 4))
    not_before_s = float(random.integers(0, 40))
    asked = (closed, _SEGMENT, _LANDING)

    leave_s = plain.closures.leave_s(*asked, not_before_s, flight_s, stop_s)

    moments = np.arange(not_before_s, 200.0, _STEP_S)
    good = [moment for moment in moments if _is_open(closed, moment, flight_s, stop_s)]
    assert leave_s == (good[0] if good else np.inf)
    if good:
        latest_s = plain.closures.leave_latest_s(*asked, leave_s, flight_s, stop_s)
        reached = moments[(moments >= leave_s) & (moments <= min(latest_s, 199.0))]
        # A drone that arrives without a stop in the moment of closing meets the closure.
        assert all(_is_open(closed, moment, flight_s, max(stop_s, 1e-6)) for moment in reached[:-1])
        if latest_s < 190:
            assert not _is_open(closed, latest_s + _STEP_S, flight_s, stop_s)


def _closed(plain: SimpleNamespace, random: np.random.Generator) -> Closed:
    starts_s = random.integers(-5, 80, 4).astype(float)
    ends_s = starts_s + random.integers(1, 20, 4)
    keys = np.array([_SEGMENT, _LANDING])
    closed: Closed = plain.records.Closed(keys, np.array([0, 2, 4]), starts_s, ends_s, 5, False)
    return closed


def _is_open(closed: Closed, leave_s: float, flight_s: float, stop_s: float) -> bool:
    uses = [(leave_s, flight_s, slice(0, 2)), (leave_s + flight_s, stop_s, slice(2, 4))]
    for start_s, duration_s, which in uses:
        from_s, until_s = closed.start_s[which], closed.end_s[which]
        meets = (from_s < start_s + duration_s) | (from_s == start_s)
        if (meets & (start_s < until_s)).any():
            return False
    return True
