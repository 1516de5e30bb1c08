"""The metrics of a process as Prometheus reads them."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from skyway.runtime.durations import DURATIONS
from skyway.runtime.gauges import Gauge, gauge_families
from skyway.runtime.metrics import COUNTERS

if TYPE_CHECKING:
    from prometheus_client import Metric


def exposition(readings: Iterable[Gauge] = ()) -> tuple[bytes, str]:
    """The counters and histograms of this process and these gauges; and their content type."""
    from prometheus_client import CollectorRegistry, ProcessCollector, generate_latest
    from prometheus_client.exposition import CONTENT_TYPE_PLAIN_1_0_0
    from prometheus_client.registry import Collector

    class _Measured(Collector):
        def collect(self) -> "Iterable[Metric]":
            yield from COUNTERS.collect()
            yield from DURATIONS.collect()
            yield from gauge_families(readings)

    registry = CollectorRegistry()
    registry.register(_Measured())
    ProcessCollector(registry=registry)
    return generate_latest(registry), CONTENT_TYPE_PLAIN_1_0_0
