"""Statistics of samples in which some values are censored.

A censored value (a run that its limit ended) is known only to be at least what it is. It counts as
infinite when values are ordered, so a quantile is either true or "at least the limit". In a mean
it counts as its limit, so the mean is then "at least". It is never left out. Every statistic has a
bootstrap interval.

Notes
-----
The growth of times with the network is the slope of a line through ln(time) over stations with
normal scatter. It is fitted to censored data by expectation maximisation (Tobin 1958, "Estimation
of relationships for limited dependent variables"; the steps are those of Aitkin 1981, "A note on
the regression analysis of censored data").
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from skyway_lab.experiments.contest import Run

_RESAMPLES = 1_000
_TAIL = 0.025

Values = NDArray[np.float64]
Statistic = Callable[[Values], float]


@dataclass(frozen=True, slots=True)
class Estimate:
    """A statistic of a sample and its 95 % bootstrap interval; `is_at_least` where censored."""

    value: float
    low: float
    high: float
    is_at_least: bool = False


@dataclass(frozen=True, slots=True)
class Sample:
    """Values, and which of them are censored."""

    values: tuple[float, ...]
    is_censored: tuple[bool, ...]

    @classmethod
    def of(cls, values: Sequence[float]) -> Self:
        """A sample without censored values; an infinite one is censored."""
        return cls(tuple(values), tuple(value == math.inf for value in values))

    @classmethod
    def of_times(cls, runs: Sequence[Run]) -> Self:
        """The execution times of these runs."""
        return cls(tuple(run.elapsed_s for run in runs), tuple(run.is_censored for run in runs))

    @property
    def share_finished(self) -> float:
        """The share of values that are not censored."""
        return 1 - sum(self.is_censored) / len(self.values)

    def quantile(self, share: float, *, seed: int = 0) -> Estimate:
        """The smallest value that this share of the sample does not exceed."""
        ordered = np.where(self.is_censored, np.inf, self.values)
        estimate = _estimate(ordered, lambda values: _quantile(values, share), seed=seed)
        if estimate.value < math.inf:
            return estimate
        limit = min(value for value, cut in zip(self.values, self.is_censored, strict=True) if cut)
        return Estimate(limit, min(limit, estimate.low), math.inf, is_at_least=True)

    def median(self, *, seed: int = 0) -> Estimate:
        """The middle of the sample, the lower of the two if there are two."""
        return self.quantile(0.5, seed=seed)

    def mean(self, *, seed: int = 0) -> Estimate:
        """The mean, at least, where some values are censored."""
        estimate = _estimate(np.array(self.values), lambda values: float(values.mean()), seed=seed)
        return Estimate(estimate.value, estimate.low, estimate.high, any(self.is_censored))


def _quantile(values: Values, share: float) -> float:
    rank = max(0, math.ceil(share * len(values)) - 1)
    return float(np.partition(values, rank)[rank])


def _estimate(values: Values, statistic: Statistic, *, seed: int) -> Estimate:
    random = np.random.default_rng(seed)
    resamples = np.sort(
        [statistic(values[random.integers(0, len(values), len(values))]) for _ in range(_RESAMPLES)]
    )
    low, high = (resamples[math.floor(tail * (_RESAMPLES - 1))] for tail in (_TAIL, 1 - _TAIL))
    return Estimate(statistic(values), float(low), float(high))


Floats = NDArray[np.float64]

_STEPS = 60
_LEAST_SPREAD = 1e-3
_erfc = np.vectorize(math.erfc, otypes=[np.float64])


@dataclass(frozen=True, slots=True)
class LogTimes:
    """Sizes of networks, the logarithms of times on them, and which times are censored."""

    stations: Floats
    log_s: Floats
    is_censored: NDArray[np.bool_]

    def drawn(self, rows: NDArray[np.int64]) -> "LogTimes":
        """These rows, as a resample draws them."""
        return LogTimes(self.stations[rows], self.log_s[rows], self.is_censored[rows])

    @property
    def has_a_slope(self) -> bool:
        """Whether runs of at least two sizes have finished."""
        return len(set(self.stations[~self.is_censored])) > 1


def growth_per_station(times: LogTimes) -> float:
    """By how much ln(time) grows with every station."""
    expected = times.log_s.copy()
    spread = max(float(np.std(times.log_s)), _LEAST_SPREAD)
    from_middle = times.stations - times.stations.mean()
    slope = 0.0
    for _ in range(_STEPS):
        slope = float(from_middle @ expected) / float(from_middle @ from_middle)
        line = expected.mean() + slope * from_middle
        beyond = (times.log_s - line) / spread
        hazard = _hazard(beyond)
        expected = np.where(times.is_censored, line + spread * hazard, times.log_s)
        variance = np.where(times.is_censored, spread**2 * (1 + beyond * hazard - hazard**2), 0.0)
        squares = (expected - line) ** 2 + np.maximum(variance, 0.0)
        spread = max(math.sqrt(float(squares.mean())), _LEAST_SPREAD)
    return slope


def _hazard(z: Floats) -> Floats:
    """Density over survival of the standard normal; far out it is nearly `z` itself."""
    far = np.maximum(z, 0.0) + 1 / np.maximum(z, 1.0)
    near = np.minimum(z, 8.0)
    density = np.exp(-(near**2) / 2) / math.sqrt(2 * math.pi)
    return np.where(z > 8.0, far, density / (_erfc(near / math.sqrt(2)) / 2))
