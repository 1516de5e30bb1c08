"""What services count and measure, as operators see it in the picture: queues, lags and rates.

It is read apart from the looks, so that no look waits for it.
"""

import asyncio
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from skyway.contracts.figures import FIGURES, Figure, Figures
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.metrics_routes import figures_of
from skyway.runtime.loops import repeat
from skyway.runtime.metrics import Gauges
from skyway_gateway.live.feed import LiveFeed
from skyway_gateway.live.picture import JsonObject

#: Wall seconds between two readings; services keep what they have measured as long.
_READ_EVERY_S: Final = 5.0
#: How long a service may take, wall seconds.
_WITHIN_S: Final = 2.0
_DIGITS: Final = 2

#: The gauges that are shown, and their members. With labels, a member is an object of numbers.
_MEASURED: Final = {
    "skyway_queue_depth": "queue_depth",
    "skyway_queue_age_seconds": "queue_age_s",
    "skyway_outbox_depth": "outbox_depth",
    "skyway_outbox_age_seconds": "outbox_age_s",
    "skyway_planning_depth": "planning_depth",
    "skyway_missions_to_replan": "missions_to_replan",
    "skyway_quarantine_depth": "quarantine_depth",
    "skyway_drone_lag_mean_seconds": "drone_lag_mean_s",
    "skyway_drone_lag_max_seconds": "drone_lag_max_s",
    "skyway_telemetry_depth": "telemetry_depth",
    "skyway_telemetry_age_seconds": "telemetry_age_s",
}
#: The counters whose rates are shown, over all their labels, and their members.
_COUNTED: Final = {
    "skyway_http_requests": "requests_per_s",
    "skyway_outbox_sends": "messages_sent_per_s",
    "skyway_telemetry_written": "samples_written_per_s",
}
#: Two readings with the same start are of the same process, and not of two replicas.
_START: Final = "process_start_time_seconds"


@dataclass(frozen=True, slots=True)
class _Counted:
    """The counters of a process at a moment of its reader's wall time."""

    start: float | None
    at_s: float
    sums: Mapping[str, float]


@dataclass(slots=True)
class LiveFigures:
    """Brings the figures of the picture up to date while an operator looks at it."""

    feed: LiveFeed
    clients: Callable[[], Mapping[str, ServiceClient]]
    gauges: Gauges
    now: Callable[[], float] = time.monotonic
    _counted: dict[str, _Counted] = field(default_factory=dict)

    async def run(self) -> None:
        """Read until cancelled."""
        await repeat("live figures", self.step, every_s=_READ_EVERY_S)

    async def step(self) -> bool:
        """Step of a loop: read what each service says, if an operator looks."""
        if not self.feed.views_of("operator", ""):
            self.feed.figures.clear()
            self._counted.clear()
            return False
        clients = self.clients()
        answers = await asyncio.gather(*map(self._ask, clients.values()))
        said = dict(zip(clients, answers, strict=True))
        said["gateway"] = figures_of(await self.gauges.read())
        for name, figures in said.items():
            self.feed.figures[name] = self._shown(name, figures.figures)
        return False

    async def _ask(self, client: ServiceClient) -> Figures:
        try:
            return await client.call("GET", FIGURES, answer=Figures, timeout_s=_WITHIN_S)
        except (RemoteProblem, ServiceUnavailable):
            return Figures(figures=())

    def _shown(self, name: str, figures: Sequence[Figure]) -> JsonObject:
        counted, before = _counters(figures, self.now()), self._counted.get(name)
        self._counted[name] = counted
        return measured(figures) | _rates(before, counted)


def measured(figures: Iterable[Figure]) -> dict[str, Any]:  # numbers, or objects of numbers
    """The gauges that are shown, by their members."""
    shown: dict[str, Any] = {}
    for each in figures:
        member = _MEASURED.get(each.name)
        if member is None:
            continue
        value = round(each.value, _DIGITS)
        if each.labels:
            shown.setdefault(member, {})[",".join(each.labels.values())] = value
        else:
            shown[member] = value
    return shown


def _counters(figures: Iterable[Figure], at_s: float) -> _Counted:
    start, sums = None, dict.fromkeys(_COUNTED, 0.0)
    for each in figures:
        name = each.name.removesuffix("_total")
        if name == _START:
            start = each.value
        elif name in sums:
            sums[name] += each.value
    return _Counted(start, at_s, sums)


def _rates(before: _Counted | None, after: _Counted) -> dict[str, float]:
    """How fast counters have grown between two readings of the same process."""
    if before is None or after.start is None or before.start != after.start:
        return {}
    passed_s = after.at_s - before.at_s
    return {
        member: round((after.sums[name] - before.sums[name]) / passed_s, _DIGITS)
        for name, member in _COUNTED.items()
        if after.sums[name]
    }
