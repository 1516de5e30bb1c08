"""When packages may change hands: the windows of the pick-up and of each destination.

A window holds the whole act: loading or a hand-over begins at or after `not_before_s` and ends at
or before `latest_s`. Packages for one station are handed over together, so their windows are
intersected. In a problem with windows the drone may pass a place where packages change hands, and
wait or recharge there first.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from skyway.ids import StationId
from skyway.planner.closures import Interval
from skyway.planner.problem import Problem
from skyway.units import TIME_TOLERANCE_S

_ALWAYS: tuple[Interval, ...] = ((-math.inf, math.inf),)


@dataclass(frozen=True, slots=True)
class Windows:
    """When loading and hand-overs may begin.

    `may_pass` says whether the problem has windows. `starts` holds, by station, the moments from
    first to last at which loading (at the source) or the hand-over may begin, in seconds, sorted
    and apart; a station without windows is not in it.
    """

    may_pass: bool = False
    starts: Mapping[StationId, tuple[Interval, ...]] = field(default_factory=dict)

    @classmethod
    def of(cls, problem: Problem) -> "Windows":
        """The windows of this problem."""
        if not problem.has_windows:
            return cls()
        stations = dict.fromkeys([problem.source, *(one.destination for one in problem.packages)])
        return cls(True, {station: _starts(problem, station) for station in stations})

    def starts_at(self, station_id: StationId) -> tuple[Interval, ...]:
        """When loading or the hand-over at this station may begin; empty for never."""
        return self.starts.get(station_id, _ALWAYS)

    def opened(self) -> "Windows":
        """The same problem as if every window were always open."""
        return replace(self, starts={})

    def ending(self, ends_s: Mapping[StationId, float]) -> "Windows":
        """The same with these last moments to begin at each station, and no others."""
        starts = {
            station_id: tuple(
                (from_s, ends_s.get(station_id, math.inf)) for from_s, _ in windows[:1]
            )
            for station_id, windows in self.starts.items()
        }
        return replace(self, starts=starts)


def _starts(problem: Problem, station_id: StationId) -> tuple[Interval, ...]:
    """When the act at this station may begin; empty if the windows leave no time."""
    from_s, until_s = -math.inf, math.inf
    takes_s = problem.dropoff_s
    if station_id == problem.source:
        # Packages for the source itself are handed over right after loading.
        takes_s += problem.loading_s
        if problem.pickup_not_before_s is not None:
            from_s = problem.pickup_not_before_s
        if problem.pickup_latest_s is not None:
            until_s = problem.pickup_latest_s - problem.loading_s
    for package in problem.packages:
        if package.destination != station_id:
            continue
        if package.not_before_s is not None:
            from_s = max(from_s, package.not_before_s - (takes_s - problem.dropoff_s))
        if package.latest_s is not None:
            until_s = min(until_s, package.latest_s - takes_s)
    return ((from_s, until_s),) if from_s <= until_s + TIME_TOLERANCE_S else ()
