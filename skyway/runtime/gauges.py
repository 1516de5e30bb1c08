"""Gauges: numbers of the present, read when a client asks for a service's metrics.

Numbers are read only on request and kept for a few seconds, so that frequent scrapes cost no more
than rare ones.
"""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.metrics import count

if TYPE_CHECKING:
    from prometheus_client.core import GaugeMetricFamily

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
