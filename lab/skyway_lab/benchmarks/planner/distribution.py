"""Times of several runs together: median, p95, worst. A run cut off by a limit has no time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self


@dataclass(frozen=True, slots=True)
class Distribution:
    """Quantiles in milliseconds by nearest rank; None where the limit cut it off.

    `asked` is how many runs there should have been: a cell has its limit too.
    """

    asked: int
    runs: int
    finished: int
    median_ms: float | None
    p95_ms: float | None
    max_ms: float | None

    @classmethod
    def of(cls, times_ms: Sequence[float], *, cut_off: int = 0, asked: int | None = None) -> Self:
        """The quantiles of these times and `cut_off` unfinished runs, which count as the latest."""
        ranked = sorted(times_ms) + [math.inf] * cut_off
        return cls(
            asked=len(ranked) if asked is None else asked,
            runs=len(ranked),
            finished=len(times_ms),
            median_ms=_quantile(ranked, 0.5),
            p95_ms=_quantile(ranked, 0.95),
            max_ms=_quantile(ranked, 1.0),
        )

    def as_text(self) -> str:
        """Median / p95 / worst, and how many of the runs finished if not all asked did."""
        if not self.runs:
            return "no run"
        times = " / ".join(
            milliseconds(time_ms) for time_ms in (self.median_ms, self.p95_ms, self.max_ms)
        )
        return times if self.finished == self.asked else f"{times} ({self.finished} of {self.runs})"


def milliseconds(time_ms: float | None) -> str:
    """The time with two or three significant digits; "limit" for None."""
    if time_ms is None:
        return "limit"
    if time_ms >= 10:
        return f"{time_ms:,.0f}"
    return f"{time_ms:.1f}" if time_ms >= 1 else f"{time_ms:.2f}"


def _quantile(ranked: Sequence[float], share: float) -> float | None:
    if not ranked:
        return None
    value = ranked[math.ceil(share * len(ranked)) - 1]
    return None if value == math.inf else value
