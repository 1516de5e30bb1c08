"""When packages may change hands: the windows of the pickup and of each destination.

A window holds the whole act: loading or a hand-over begins at or after `not_before_s` and ends at
or before `latest_s`. Packages for one station are handed over together, so their windows are
intersected. In a problem with windows the drone may pass a place where packages change hands, and
wait or recharge there first.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from skyway.ids import StationId
from skyway.planner.closures import Interval, open_hours_s
from skyway.planner.problem import Problem
from skyway.units import time_tolerance_s

_ALWAYS: Interval = (-math.inf, math.inf)


@dataclass(frozen=True, slots=True)
class Windows:
    """When loading and hand-overs may begin.

    `may_pass` says whether the problem has windows, or the place of a pickup or hand-over has
    opening hours. By station: `limits` are the first and the last moment at which loading (at the
    source) or the hand-over may begin by the windows, and `open_starts` the moments by the opening
    hours, in order and apart; seconds. Stations without such limits are not in them.
    """

    may_pass: bool = False
    limits: Mapping[StationId, Interval] = field(default_factory=dict)
    open_starts: Mapping[StationId, tuple[Interval, ...]] = field(default_factory=dict)

    @classmethod
    def of(cls, problem: Problem) -> "Windows":
        """The windows of this problem."""
        if not problem.may_pass:
            return cls()
        stations = dict.fromkeys([problem.source, *(one.destination for one in problem.packages)])
        hours = problem.network.opening_hours
        # A drone with its packages on board leaves the source also when it is closed.
        loads_or_delivers = not problem.are_on_board or any(
            one.destination == problem.source for one in problem.packages
        )
        return cls(
            True,
            {station: _limits(problem, station) for station in stations},
            {
                station: _open_starts(problem, station)
                for station in stations
                if station in hours and (station != problem.source or loads_or_delivers)
            },
        )

    def starts_at(self, station_id: StationId) -> tuple[Interval, ...]:
        """When loading or the hand-over at this station may begin; empty for never."""
        from_s, until_s = self.limits.get(station_id, _ALWAYS)
        both = (
            (max(from_s, opens_s), min(until_s, closes_s))
            for opens_s, closes_s in self.open_starts.get(station_id, (_ALWAYS,))
        )
        return tuple(
            (from_s, until_s)
            for from_s, until_s in both
            if from_s <= until_s + time_tolerance_s(until_s) / 2
        )

    def opened(self) -> "Windows":
        """The same problem as if every window were always open, within the opening hours."""
        return replace(self, limits={})

    def always(self) -> "Windows":
        """The same problem as if every window and every station were always open."""
        return replace(self, limits={}, open_starts={})

    def ending(self, ends_s: Mapping[StationId, float]) -> "Windows":
        """The same with these last moments to begin at each station, and no others."""
        limits = {
            station_id: (from_s, ends_s.get(station_id, math.inf))
            for station_id, (from_s, _) in self.limits.items()
        }
        return replace(self, limits=limits)


def _limits(problem: Problem, station_id: StationId) -> Interval:
    """From when until when the act at this station may begin; reversed if that is never."""
    from_s, until_s = _ALWAYS
    takes_s = _takes_s(problem, station_id)
    if station_id == problem.source:
        loading = problem.loading
        if loading.not_before_s is not None:
            from_s = loading.not_before_s
        if loading.latest_s is not None:
            until_s = loading.latest_s - loading.takes_s
    for package in problem.packages:
        if package.destination != station_id:
            continue
        if package.not_before_s is not None:
            from_s = max(from_s, package.not_before_s - (takes_s - problem.dropoff_s))
        if package.latest_s is not None:
            until_s = min(until_s, package.latest_s - takes_s)
    return from_s, until_s


def _open_starts(problem: Problem, station_id: StationId) -> tuple[Interval, ...]:
    """When the act at this station may begin, so that it is over before the station closes."""
    takes_s = _takes_s(problem, station_id)
    return tuple(
        (opens_s, closes_s - takes_s) for opens_s, closes_s in open_hours_s(problem, station_id)
    )


def _takes_s(problem: Problem, station_id: StationId) -> float:
    """How long the hand-over takes, or loading with the hand-over of packages for the source."""
    if station_id != problem.source:
        return problem.dropoff_s
    has_own = any(one.destination == station_id for one in problem.packages)
    return problem.loading.takes_s + (problem.dropoff_s if has_own else 0.0)
