"""The printed table, computed from the requests sent, the events received and the samples."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.load.cpu import CpuReading
from skyway_lab.benchmarks.load.follow import Followed
from skyway_lab.benchmarks.load.send import Sent

from skyway.contracts.delivery_event import DeliveryEventType
from skyway.ids import DeliveryId

#: Rounds of booking in which somebody else was faster, as composition counts them.
_CONFLICTS: Final = "skyway_booking_conflicts_total"


@dataclass(frozen=True, slots=True)
class Usage:
    """Processor time taken before the burst, and from its start on."""

    idle: CpuReading
    idle_s: float
    busy: CpuReading
    busy_s: float


@dataclass(frozen=True, slots=True)
class Outcome:
    """All that a run has found out; moments are monotonic seconds."""

    burst: Burst
    started_s: float
    sent: Sent
    followed: Followed
    usage: Usage
    counted: Mapping[str, float]
    violations: str

    @property
    def is_right(self) -> bool:
        """Whether no invariant is broken."""
        return self.violations.startswith("0 violations")

    def rows(self) -> list[tuple[str, ...]]:
        """The issue's table, what is measured and its value."""
        sent, followed = self.sent, self.followed
        planned = followed.of(DeliveryEventType.PLANNED)
        dispatched = followed.of(DeliveryEventType.DISPATCHED)
        rejected = sum(followed.rejections.values())
        reasons = "; ".join(f"{count} {codes}" for codes, count in followed.rejections.items())
        refused = "; ".join(f"{count} {status}" for status, count in sent.refused.items())
        return [
            ("requests accepted", f"{len(sent.asked_at)}"),
            ("requests refused", refused or "0"),
            ("our own lateness, p99", _ms(percentile(sent.late_s, 99))),
            ("POST accepted, p50 / p99", _both(sent.answered_within_s)),
            ("request to planned, p50 / p99", _both(self._after_request(planned))),
            ("request to dispatch, p50 / p99", _both(self._after_request(dispatched))),
            ("planned a second of the burst", self._rate(planned.values())),
            ("dispatched a second of the burst", self._rate(dispatched.values())),
            ("planned, dispatched in the end", f"{len(planned)}, {len(dispatched)}"),
            ("completed meanwhile", f"{len(followed.of(DeliveryEventType.COMPLETED))}"),
            ("recompositions", f"{followed.replanned}"),
            ("conflicts", f"{self.counted.get(_CONFLICTS, 0.0):g}"),
            ("rejected", f"{rejected}" + (f": {reasons}" if reasons else "")),
            ("invariants", self.violations),
        ]

    def cpu_rows(self) -> list[tuple[str, ...]]:
        """Each process: share of a core while idle, during the run, and ms for each delivery.

        A delivery counts when it is dispatched, or when it is completed if whole flights are
        measured.
        """
        usage = self.usage
        counted = max(1, self.followed.count(self.burst.counted_event))
        rows: list[tuple[str, ...]] = []
        for name, busy_s in usage.busy.seconds.items():
            idle = usage.idle.seconds.get(name, 0.0) / usage.idle_s
            own_s = max(0.0, busy_s - idle * usage.busy_s)
            rows.append(_cpu_row(name, idle, busy_s / usage.busy_s, own_s / counted))
        idle = sum(usage.idle.seconds.values()) / usage.idle_s
        busy_s = sum(usage.busy.seconds.values())
        own_s = busy_s - idle * usage.busy_s
        rows.append(_cpu_row("all of ours", idle, busy_s / usage.busy_s, own_s / counted))
        others_s = max(0.0, usage.busy.machine_s - busy_s) / usage.busy_s
        rows.append(("everybody else", "", f"{others_s:.2f}", ""))
        return rows

    def _after_request(self, received_at: Mapping[DeliveryId, float]) -> list[float]:
        asked = self.sent.asked_at
        return [at_s - asked[one] for one, at_s in received_at.items() if one in asked]

    def _rate(self, moments: Iterable[float]) -> str:
        within = sum(at_s <= self.started_s + self.burst.seconds for at_s in moments)
        return f"{within / self.burst.seconds:.1f}"


def _cpu_row(name: str, idle: float, busy: float, each_s: float) -> tuple[str, str, str, str]:
    return name, f"{idle:.2f}", f"{busy:.2f}", f"{1e3 * each_s:.1f}"


def _both(values: list[float]) -> str:
    return f"{_ms(percentile(values, 50))} / {_ms(percentile(values, 99))}"


def percentile(values: list[float], percent: float) -> float | None:
    """The smallest value that at least so many percent do not exceed."""
    if not values:
        return None
    return sorted(values)[max(0, math.ceil(len(values) * percent / 100) - 1)]


def _ms(value_s: float | None) -> str:
    return "none" if value_s is None else f"{1e3 * value_s:.0f} ms"
