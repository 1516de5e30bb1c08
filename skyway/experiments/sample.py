"""What a sample says: quantiles, means, shares, each with a bootstrap interval.

A censored value (a run that its limit ended) is known only to be at least what it is. It counts as
infinite when values are ordered, so a quantile is either true or "at least the limit"; and as its
limit in a mean, which is then "at least". It is never left out.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from skyway.experiments.contest import Run

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
