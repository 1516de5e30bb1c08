import numpy as np
import pytest

from skyway.experiments.censored_growth import LogTimes, growth_per_station

SLOPE = 0.25


def times(*, limit: float) -> LogTimes:
    """Log times that grow by `SLOPE` a station with a spread of 1, cut at a limit."""
    stations = np.repeat(np.arange(10.0, 36.0), 8)
    log_s = SLOPE * stations + np.random.default_rng(1).normal(size=stations.size)
    return LogTimes(stations, np.minimum(log_s, limit), log_s >= limit)


def test_without_limit_the_slope_is_that_of_the_line():
    whole = times(limit=np.inf)

    assert growth_per_station(whole) == pytest.approx(SLOPE, abs=0.02)


def test_a_limit_does_not_make_the_growth_look_slower():
    cut = times(limit=SLOPE * 22)

    assert cut.is_censored.mean() > 0.4
    assert growth_per_station(cut) == pytest.approx(SLOPE, abs=0.03)
    assert np.polyfit(cut.stations, cut.log_s, 1)[0] < 0.6 * SLOPE


def test_only_censored_times_give_no_slope():
    assert not times(limit=-10.0).tells_a_slope
