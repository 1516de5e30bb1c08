"""The figures of a day's deliveries: lateness, new plans, and the charge at landings."""

import statistics
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any, Final, Self

#: A state of charge may be reported so much too low, because sensors err.
SENSOR_ERROR_SOC: Final = 0.005

#: Packages that come later by more than this count as late, minutes.
_LATE_MIN: Final = 10.0


@dataclass(frozen=True, slots=True)
class Day:
    """The figures of a day; lateness is in minutes after `promised_at`, or after `due_at`."""

    states: Mapping[str, int]
    late_min: Sequence[float]
    #: After the promise of each package: its P90, or `promised_at` if no P90 was known.
    late_of_due_min: Sequence[float]
    #: For each package with a P90: whether it came by then.
    by_p90: Sequence[bool]
    #: New plans of each mission that was flown.
    new_plans: Sequence[int]
    refused: int
    landings: int
    landings_below_reserve: int
    #: Drones that came down away from every station.
    down: int
    violations: str = ""
    #: How often missions got a new plan, and how often they ended early, by reason. Only days in
    #: virtual time have these numbers.
    replanned_by: Mapping[str, int] = field(default_factory=dict)
    ended_by: Mapping[str, int] = field(default_factory=dict)

    def with_violations(self, violations: str) -> Self:
        """With what `skyway verify` says."""
        return replace(self, violations=violations)

    def __add__(self, other: "Day") -> "Day":
        """Both days together."""
        return Day(
            states=Counter(self.states) + Counter(other.states),
            late_min=[*self.late_min, *other.late_min],
            late_of_due_min=[*self.late_of_due_min, *other.late_of_due_min],
            by_p90=[*self.by_p90, *other.by_p90],
            new_plans=[*self.new_plans, *other.new_plans],
            refused=self.refused + other.refused,
            landings=self.landings + other.landings,
            landings_below_reserve=self.landings_below_reserve + other.landings_below_reserve,
            down=self.down + other.down,
            violations=self.violations if self.violations == other.violations else "differ",
            replanned_by=Counter(self.replanned_by) + Counter(other.replanned_by),
            ended_by=Counter(self.ended_by) + Counter(other.ended_by),
        )

    def row(self) -> tuple[str, ...]:
        """The day as cells of the table."""
        late = [each > _LATE_MIN for each in self.late_min]
        late_of_due = [each > _LATE_MIN for each in self.late_of_due_min]
        return (
            ", ".join(f"{number} {state}" for state, number in sorted(self.states.items())),
            f"{_quantile(self.late_min, 0.5):.1f} / {_quantile(self.late_min, 0.9):.1f}",
            _share(late),
            _share(late_of_due),
            f"{_share(self.by_p90)} of {len(self.by_p90)}",
            f"{statistics.fmean(self.new_plans):.1f}" if self.new_plans else "",
            f"{self.refused}",
            f"{self.landings_below_reserve} of {self.landings}",
            f"{self.down}",
            self.violations,
            _by_reason(self.replanned_by),
            _by_reason(self.ended_by),
        )


HEADER: Final = (
    "deliveries",
    "late p50 / p90 min",
    "10 min later than planned",
    "10 min later than promised",
    "by P90",
    "new plans a mission",
    "missions refused by drones",
    "landings below the reserve",
    "down outside a station",
    "verify",
    "new plans by reason",
    "missions that failed, by reason",
)


def figures_of(
    deliveries: Iterable[Mapping[str, Any]],
    missions: Iterable[Mapping[str, Any]],
    critical_alarms: Iterable[Mapping[str, Any]],
    *,
    reserve_soc: float,
) -> Day:
    """The figures of these deliveries and their missions, as the gateway shows them."""
    deliveries, missions = list(deliveries), list(missions)
    delivered = [
        package
        for delivery in deliveries
        for package in delivery["packages"]
        if package["delivered_at"] and package["promised_at"]
    ]
    socs = [soc for mission in missions for soc in _socs_at_landings(mission["steps"])]
    low = [soc for soc in socs if soc < reserve_soc - SENSOR_ERROR_SOC]
    flown = [each["mission"] for each in missions if each["mission"]["state"] != "REFUSED"]
    return Day(
        states=Counter(each["state"] for each in deliveries),
        late_min=[_later_min(each["delivered_at"], each["promised_at"]) for each in delivered],
        late_of_due_min=[
            _later_min(each["delivered_at"], each["due_at"] or each["promised_at"])
            for each in delivered
        ],
        by_p90=[
            _later_min(each["delivered_at"], each["promised_p90_at"]) <= 0
            for each in delivered
            if each["promised_p90_at"]
        ],
        new_plans=[each["revision"] - 1 for each in flown],
        refused=len(missions) - len(flown),
        landings=len(socs),
        landings_below_reserve=len(low),
        down=len(
            {each["drone_id"] for each in critical_alarms if each["code"] == "FORCED_LANDING"}
        ),
    )


def _by_reason(counted: Mapping[str, int]) -> str:
    """The reasons with their numbers, the most frequent first."""
    return ", ".join(f"{number} {code}" for code, number in Counter(counted).most_common())


def _socs_at_landings(steps: Iterable[Mapping[str, Any]]) -> list[float]:
    """The charge at the end of each flight that has landed."""
    return [
        each["event"]["soc"]
        for each in steps
        if each["step"]["kind"] == "FLY" and each["step"]["lands"] and each["event"] is not None
    ]


def _later_min(moment: str, than: str) -> float:
    later = datetime.fromisoformat(moment) - datetime.fromisoformat(than)
    return later.total_seconds() / 60


def _quantile(values: Sequence[float], share: float) -> float:
    """The value that this share of the values does not exceed; 0 without values."""
    if not values:
        return 0.0
    ordered = sorted(max(0.0, each) for each in values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def _share(values: Sequence[bool]) -> str:
    return f"{sum(values) / len(values):.0%}" if values else "none"
