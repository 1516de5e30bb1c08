"""How fast times grow with the network when some of them are only known to be at least a limit.

Notes
-----
A line through ln(time) over stations with normal scatter, fitted to censored data by expectation
maximisation (Tobin 1958, "Estimation of relationships for limited dependent variables"; the steps
are those of Aitkin 1981, "A note on the regression analysis of censored data").
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
    def tells_a_slope(self) -> bool:
        """Whether times of at least two sizes are known."""
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
