"""How long things take in a process: histograms of seconds of wall time.

Like counting, this needs nothing but this file. An observation costs about a microsecond.
"""

from bisect import bisect_left
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import accumulate
from time import perf_counter
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from prometheus_client.core import HistogramMetricFamily

#: The upper bounds of the buckets, seconds: from a small plan to a drone that answers late.
BOUNDS_S: Final = (
    0.001,
    0.0025,
    0.005,
    0.01,
    0.025,
    0.05,
    0.1,
    0.25,
    0.5,
    1.0,
    2.5,
    5.0,
    10.0,
    30.0,
    60.0,
)

_Labels = tuple[tuple[str, str], ...]


class _Series:
    """The observations under one set of labels."""

    def __init__(self) -> None:
        self.counts = [0] * (len(BOUNDS_S) + 1)
        self.sum_s = 0.0


class Durations:
    """Histograms, each named ``skyway_..._seconds`` and distinguished by labels.

    All series of one name have the same labels.
    """

    def __init__(self) -> None:
        self._about: dict[str, str] = {}
        self._series: dict[str, dict[_Labels, _Series]] = {}

    def add(self, name: str, about: str, duration_s: float, **labels: str) -> None:
        """Add one duration to the histogram `name`; `about` says what takes so long.

        A negative duration counts as 0: the machine's clock may be set back.
        """
        self._about[name] = about
        by_labels = self._series.setdefault(name, {})
        key = tuple(sorted(labels.items()))
        series = by_labels.get(key)
        if series is None:
            series = by_labels[key] = _Series()
        duration_s = max(duration_s, 0.0)
        series.counts[bisect_left(BOUNDS_S, duration_s)] += 1
        series.sum_s += duration_s

    def count_of(self, name: str, **labels: str) -> int:
        """How many durations were added under exactly these labels."""
        series = self._series.get(name, {}).get(tuple(sorted(labels.items())))
        return 0 if series is None else sum(series.counts)

    def collect(self) -> "Iterable[HistogramMetricFamily]":
        """The histograms in the form that prometheus_client collects."""
        from prometheus_client.core import HistogramMetricFamily

        bounds = [*(str(bound) for bound in BOUNDS_S), "+Inf"]
        for name, by_labels in self._series.items():
            names = [label for label, _ in next(iter(by_labels))]
            family = HistogramMetricFamily(name, self._about[name], labels=names)
            for key, series in by_labels.items():
                buckets = list(zip(bounds, accumulate(series.counts), strict=True))
                family.add_metric([value for _, value in key], buckets, series.sum_s)
            yield family


#: The histograms of this process.
DURATIONS: Final = Durations()


def observe(name: str, about: str, duration_s: float, **labels: str) -> None:
    """Observe in this process: ``observe("skyway_planning_duration_seconds", "plans", 0.2)``."""
    DURATIONS.add(name, about, duration_s, **labels)


@contextmanager
def timed(name: str, about: str, **labels: str) -> Iterator[None]:
    """Observe how long the block takes, also when it raises an error."""
    started_at = perf_counter()
    try:
        yield
    finally:
        observe(name, about, perf_counter() - started_at, **labels)
