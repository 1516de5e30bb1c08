"""What a process measures: counters, histograms of durations, and gauges.

`skyway.runtime.http.metrics_routes` shows them to Prometheus. Counting needs nothing but this file,
so that the drone agent stays light: only a service that is asked for its metrics imports
prometheus_client. An observation costs about a microsecond. Gauges are numbers of the present: they
are read only on request and kept for a few seconds, so that frequent scrapes cost no more than rare
ones.
"""

import asyncio
import logging
import time
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Awaitable, Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import accumulate
from time import perf_counter
from typing import TYPE_CHECKING, Final

from skyway.runtime.errors import ServiceUnavailable

if TYPE_CHECKING:
    from prometheus_client.core import (
        CounterMetricFamily,
        GaugeMetricFamily,
        HistogramMetricFamily,
    )

#: The file in the secrets folder with the key of GET /metrics.
METRICS_KEY: Final = "metrics_key"

_Labels = tuple[tuple[str, str], ...]


class Counters:
    """Numbers that only grow, each named ``skyway_...`` and distinguished by labels."""

    def __init__(self) -> None:
        self._about: dict[str, str] = {}
        self._values: dict[str, dict[_Labels, float]] = defaultdict(dict)

    def add(self, name: str, about: str, amount: float = 1.0, **labels: str) -> None:
        """Add `amount` to the counter `name`; `about` says what it counts."""
        self._about[name] = about
        series = self._values[name]
        key = tuple(sorted(labels.items()))
        series[key] = series.get(key, 0.0) + amount

    def value(self, name: str, **labels: str) -> float:
        """The count under exactly these labels."""
        return self._values[name].get(tuple(sorted(labels.items())), 0.0)

    def collect(self) -> "Iterable[CounterMetricFamily]":
        """The counters in the form that prometheus_client collects."""
        from prometheus_client.core import (
            CounterMetricFamily,
        )

        for name, series in self._values.items():
            names = sorted({label for key in series for label, _ in key})
            family = CounterMetricFamily(name, self._about.get(name, name), labels=names)
            for key, value in series.items():
                labels = dict(key)
                family.add_metric([labels.get(label, "") for label in names], value)
            yield family


#: The counters of this process: a process has one set, as it has one log.
COUNTERS = Counters()


def count(name: str, about: str, amount: float = 1.0, **labels: str) -> None:
    """Count in this process: ``count("skyway_outbox_sent", "messages sent", channel="mqtt")``.

    A counter that alerts watch is counted with 0 at the start: Prometheus sees the growth of a
    series, and not that it appears.
    """
    COUNTERS.add(name, about, amount, **labels)


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


log = logging.getLogger(__name__)

#: How long numbers are kept, seconds of wall time.
_KEPT_S: Final = 5.0
#: Longest time that a source may take, seconds of wall time. Prometheus waits for 10 s by default.
_WITHIN_S: Final = 2.0


@dataclass(frozen=True, slots=True)
class Gauge:
    """One number of a gauge; `about` says what it is."""

    name: str
    about: str
    value: float
    labels: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class GaugeSource:
    """Where some gauges come from, and how long their numbers are kept, wall seconds."""

    name: str
    read: Callable[[], Awaitable[Iterable[Gauge]]]
    kept_s: float = _KEPT_S


class Gauges:
    """The gauges of a service. A source that does not answer is left out and counted."""

    def __init__(
        self, *, within_s: float = _WITHIN_S, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._sources: list[GaugeSource] = []
        self._within_s = within_s
        self._now = now
        self._kept: dict[str, tuple[float, tuple[Gauge, ...]]] = {}
        #: Concurrent callers share one reading.
        self._turn = asyncio.Lock()

    def show(self, *sources: GaugeSource) -> None:
        """Read these sources too."""
        self._sources += sources
        for source in sources:
            _count_unread(0, source)

    async def read(self) -> tuple[Gauge, ...]:
        """All numbers, none of them older than its source keeps them."""
        async with self._turn:
            found = [await self._read(source) for source in self._sources]
        return tuple(reading for readings in found for reading in readings)

    async def _read(self, source: GaugeSource) -> tuple[Gauge, ...]:
        read_at, readings = self._kept.get(source.name, (None, ()))
        if read_at is not None and self._now() - read_at < source.kept_s:
            return readings
        self._kept.pop(source.name, None)
        try:
            async with asyncio.timeout(self._within_s):
                readings = tuple(await source.read())
        except (ServiceUnavailable, TimeoutError) as error:
            _count_unread(1, source)
            log.info("gauges not read", extra={"source": source.name, "reason": str(error)})
            return ()
        self._kept[source.name] = (self._now(), readings)
        return readings


def _count_unread(times: int, source: GaugeSource) -> None:
    count("skyway_gauges_unread", "gauges that could not be read", times, source=source.name)


def gauge_families(readings: Iterable[Gauge]) -> "Iterable[GaugeMetricFamily]":
    """These readings in the form that prometheus_client collects."""
    from prometheus_client.core import GaugeMetricFamily

    families: dict[str, GaugeMetricFamily] = {}
    for reading in readings:
        family = families.get(reading.name)
        if family is None:
            names = list(reading.labels)
            family = families[reading.name] = GaugeMetricFamily(
                reading.name, reading.about, labels=names
            )
        family.add_metric(list(reading.labels.values()), reading.value)
    return families.values()
