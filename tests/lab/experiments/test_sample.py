import math

import numpy as np
import pytest
from skyway_lab.experiments.sample import LogTimes, Sample, growth_per_station


def times(*values: float, censored: int = 0) -> Sample:
    """The last so many are censored."""
    whole = len(values) - censored
    return Sample(values, tuple(number >= whole for number in range(len(values))))


def test_a_median_below_the_limit_is_exact_although_some_runs_are_censored():
    median = times(1.0, 2.0, 3.0, 10.0, 10.0, censored=2).median()

    assert (median.value, median.is_at_least) == (3.0, False)


def test_a_median_among_the_censored_is_at_least_the_limit():
    median = times(1.0, 10.0, 10.0, censored=2).median()

    assert (median.value, median.is_at_least) == (10.0, True)
    assert median.high == math.inf


def test_a_mean_counts_the_censored_with_their_limit():
    mean = times(1.0, 3.0, 8.0, censored=1).mean()

    assert (mean.value, mean.is_at_least) == (4.0, True)


def test_the_finished_share_excludes_censored_runs():
    assert times(1.0, 2.0, 9.0, 9.0, censored=2).share_finished == 0.5


def test_an_infinite_value_is_censored():
    sample = Sample.of([1.0, math.inf])

    assert sample.is_censored == (False, True)


@pytest.mark.parametrize(("share", "value"), [(0.5, 50.0), (0.95, 95.0), (1.0, 100.0)])
def test_a_quantile_is_one_of_the_values(share, value):
    sample = Sample.of([float(number) for number in range(1, 101)])

    assert sample.quantile(share).value == value


def test_an_interval_contains_its_value_and_repeats_with_its_seed():
    sample = Sample.of([float(number % 17) for number in range(60)])
    mean = sample.mean(seed=3)

    assert mean.low <= mean.value <= mean.high
    assert mean == sample.mean(seed=3)
    assert mean != sample.mean(seed=4)


SLOPE = 0.25


def log_times(*, limit: float) -> LogTimes:
    """Log times that grow by `SLOPE` a station with a spread of 1, cut at a limit."""
    stations = np.repeat(np.arange(10.0, 36.0), 8)
    log_s = SLOPE * stations + np.random.default_rng(1).normal(size=stations.size)
    return LogTimes(stations, np.minimum(log_s, limit), log_s >= limit)


def test_without_limit_the_slope_is_that_of_the_line():
    whole = log_times(limit=np.inf)

    assert growth_per_station(whole) == pytest.approx(SLOPE, abs=0.02)


def test_a_limit_does_not_make_the_growth_look_slower():
    cut = log_times(limit=SLOPE * 22)

    assert cut.is_censored.mean() > 0.4
    assert growth_per_station(cut) == pytest.approx(SLOPE, abs=0.03)
    assert np.polyfit(cut.stations, cut.log_s, 1)[0] < 0.6 * SLOPE


def test_only_censored_times_give_no_slope():
    assert not log_times(limit=-10.0).has_a_slope
