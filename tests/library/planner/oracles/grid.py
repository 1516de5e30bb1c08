"""A dynamic programme over a grid of times: the optimum between two bounds, by the planner's rules.

The rules are those of docs/reference/planner-problem.md.

A state is a tick, a station, the set of delivered packages, and air or ground. For every state the
programme keeps the most charge that a drone can have there: more charge never hurts. A drone in the
air flies on immediately. A drone on the ground may stay, and then charges whenever some pad is free
(recharge policy `full`: in whole sessions to the top). There are no labels and no bounds.

There are two programmes. The late programme rounds every duration up and every free time inward.
Its plan can be flown, so its time is never earlier than the optimum. The early programme rounds
down and outward, and lets a drone charge through the tick in which it leaves. Its time is never
later than the optimum. Where flights and windows are whole ticks, the two differ by a tick per
recharge.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from skyway.planner.problem import Problem
from tests.library.planner.oracles.facts import Facts, Interval, is_overweight, read_facts
from tests.library.planner.oracles.grid_kernel import sweep

#: Seconds after the last reservation or closure within which it looks for a plan by default.
_AFTER_LAST_EVENT_S = 7000.0

#: Charges this close are equal. The late tolerance is half of the planner's, so that every plan
#: found is valid.
_LATE_TOLERANCE, _EARLY_TOLERANCE = 0.5e-9, 2e-9

#: Segments that a drone flies over stations without landing, at most, before clocks that were
#: rounded in the air are set right on the ground.
_MOST_SEGMENTS_IN_THE_AIR = 8


@dataclass(frozen=True, slots=True)
class Bracket:
    """The optimum lies in [early_s, late_s]; infinite where none is found before `horizon_s`."""

    early_s: float
    late_s: float
    horizon_s: float
    #: The late programme's plan, a line a move, for people.
    trail: list[str] = field(default_factory=list)


def bracket(problem: Problem, *, tick_s: float, after_s: float = _AFTER_LAST_EVENT_S) -> Bracket:
    """The two bounds of the least delivery time."""
    if is_overweight(problem):
        return Bracket(math.inf, math.inf, math.inf)
    facts = read_facts(problem)
    events = [
        moment
        for calendar in (facts.free, facts.station_closed, facts.segment_closed, facts.starts)
        for intervals in calendar
        for interval in intervals
        for moment in interval
        if math.isfinite(moment)
    ]
    events += [edge for edge in facts.edges_s if math.isfinite(edge)]
    horizon_s = max([0.0, *events]) + after_s
    early_s, _ = _run(facts, tick_s, horizon_s, is_early=True)
    late_s, trail = _run(facts, tick_s, horizon_s, is_early=False)
    return Bracket(early_s, late_s, horizon_s, trail)


def _run(
    facts: Facts, tick_s: float, horizon_s: float, *, is_early: bool
) -> tuple[float, list[str]]:
    def ticks(seconds: float) -> int:
        return (
            math.floor(seconds / tick_s + 1e-6) if is_early else math.ceil(seconds / tick_s - 1e-6)
        )

    loads_later = facts.start != facts.source or facts.may_pass
    state = facts.before if loads_later else 0
    start_s = 0.0 if loads_later else facts.pick_up_s
    if state == facts.served:
        is_enough = facts.soc - facts.finish_soc[facts.start] >= facts.reserve - _EARLY_TOLERANCE
        return (start_s if is_enough and start_s <= facts.latest_s else math.inf), []
    states, stations = facts.before + 1, len(facts.names)
    by_start = sorted(range(len(facts.ends)), key=lambda segment: facts.ends[segment][0])
    longer = np.array(facts.longer).reshape(-1, 1, len(by_start))[:, :, by_start]
    harder = longer * np.array(facts.harder).reshape(-1, 1, len(by_start))[:, :, by_start]
    # By period, state and segment.
    flights = np.array(facts.flight_s).reshape(states, -1)[:, by_start] * longer
    rounded = np.array(
        [[[max(1, ticks(one)) for one in row] for row in period] for period in flights],
        dtype=np.int64,
    )
    durations = [*flights.flat, facts.stop_s, facts.pick_up_s, facts.dropoff_s]
    is_smooth = all(abs(one / tick_s - round(one / tick_s)) < 1e-6 for one in durations)
    drift_s = 0.0 if is_smooth else (_MOST_SEGMENTS_IN_THE_AIR + 1) * tick_s
    hand_overs = np.array([ticks(facts.hand_over_s(one)) for one in range(states)], dtype=np.int64)
    following = np.array(
        [[facts.after_landing_at(one, here) for here in range(stations)] for one in range(states)]
    )
    horizon = int(horizon_s / tick_s)
    windows_of, windows = _rows(facts.free)
    segment_of, segment_closed = _rows([facts.segment_closed[segment] for segment in by_start])
    station_of, station_closed = _rows(facts.station_closed)
    start_of, starts = _rows(facts.starts)
    acts = np.array(
        [[facts.act_at(one, here) for here in range(stations)] for one in range(states)]
    )
    finished, last, best, trail = sweep(
        tick_s,
        horizon,
        is_early,
        drift_s if is_early else -drift_s,
        _offsets([facts.ends[segment][0] for segment in by_start], stations),
        np.array([facts.ends[segment][1] for segment in by_start], dtype=np.int64),
        rounded,
        # For each other layout of an array, numba would compile the whole programme again.
        np.ascontiguousarray(np.array(facts.flight_soc).reshape(states, -1)[:, by_start] * harder),
        np.array(facts.edges_s, dtype=np.float64),
        following,
        hand_overs,
        facts.served,
        state,
        facts.start,
        ticks(start_s),
        facts.soc,
        facts.reserve - (_EARLY_TOLERANCE if is_early else _LATE_TOLERANCE),
        ticks(facts.stop_s),
        facts.stop_soc,
        np.array(facts.finish_soc),
        np.array(facts.curves),
        facts.is_full_policy,
        np.array([_free_ticks(pads, tick_s, horizon, is_early=is_early) for pads in facts.free]),
        windows_of,
        windows,
        segment_of,
        segment_closed,
        station_of,
        station_closed,
        facts.may_pass,
        acts,
        start_of,
        starts,
    )
    if finished < 0 or finished * tick_s > facts.latest_s + 1e-6:
        return math.inf, []
    return finished * tick_s, _trail_text(facts, tick_s, best, trail, last, finished)


def _rows(calendars: list[list[Interval]]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """All intervals in one array, and the row where each calendar begins."""
    counts = np.cumsum([0, *(len(intervals) for intervals in calendars)])
    rows = [interval for intervals in calendars for interval in intervals]
    return counts.astype(np.int64), np.array(rows, dtype=np.float64).reshape(-1, 2)


def _offsets(starts: list[int], stations: int) -> NDArray[np.int64]:
    return np.searchsorted(np.array(starts, dtype=np.int64), np.arange(stations + 1))


def _free_ticks(
    windows: list[Interval], tick_s: float, horizon: int, *, is_early: bool
) -> NDArray[np.bool_]:
    """Whether one pad is free for all of a tick (early: some pad for a part of it)."""
    starts = np.arange(horizon + 1) * tick_s
    free = np.zeros(horizon + 1, dtype=np.bool_)
    for opens, closes in windows:
        if is_early:
            free |= (starts + tick_s > opens + 1e-9) & (starts < closes - 1e-9)
        else:
            free |= (starts >= opens - 1e-9) & (starts + tick_s <= closes + 1e-9)
    return free


def _trail_text(
    facts: Facts,
    tick_s: float,
    best: NDArray[np.float64],
    trail: NDArray[np.int64],
    last: int,
    finished: int,
) -> list[str]:
    lines = [f"{finished * tick_s:g} s all delivered"]
    shape = best.shape
    before: tuple[int, ...] | None = None
    while last >= 0:
        tick, mode, state, here = (int(part) for part in np.unravel_index(last, shape))
        is_wait = before is not None and before[1:] == (mode, state, here) and mode == 1
        line = (
            f"{tick * tick_s:g} s {'on' if mode else 'over'} {facts.names[here]}"
            f" state {state:b} charge {best[tick, mode, state, here]:.6f}"
        )
        if is_wait and len(lines) > 1 and lines[-1].startswith("   since"):
            lines[-1] = "   since " + line
        elif is_wait:
            lines.append("   since " + line)
        else:
            lines.append(line)
        before = (tick, mode, state, here)
        last = int(trail[tick, mode, state, here])
    return lines[::-1]
