"""The counters of a process; `skyway.runtime.exposition` shows them to Prometheus.

Counting needs nothing but this file, so that the drone agent stays light: prometheus_client is
only imported by a service that is asked for its metrics.
"""

from collections import defaultdict
from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from prometheus_client.core import CounterMetricFamily

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
        from prometheus_client.core import CounterMetricFamily

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
