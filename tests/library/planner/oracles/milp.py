"""The problem as a mixed-integer programme for HiGHS: an oracle whose times are continuous.

Positions are numbered from 0, the start; at position p the drone stands at (or passes) a station,
and binary variables say which segment it flies from there, in which state of its packages, so that
speeds, powers and hand-overs are linear. Recharging is bounded by the charge curve: as a convex
function for the charge left with, by a choice of its pieces for the charge arrived with.

It has no closures and no zones, and a limited number of segments. A plan within that number cannot
be earlier than the optimum of the programme, and no exact plan should be later.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from skyway.planner.problem import Problem
from tests.library.planner.oracles.facts import Facts, Interval, is_overweight, read_facts

Terms = Iterable[tuple[int, float]]


@dataclass(slots=True)
class _Programme:
    """Rows and columns under construction; the objective is one variable."""

    lows: list[float] = field(default_factory=list)
    highs: list[float] = field(default_factory=list)
    integral: list[int] = field(default_factory=list)
    entries: list[tuple[int, int, float]] = field(default_factory=list)
    row_lows: list[float] = field(default_factory=list)
    row_highs: list[float] = field(default_factory=list)

    def real(self, low: float, high: float) -> int:
        return self._add(low, high, 0)

    def binary(self) -> int:
        return self._add(0, 1, 1)

    def _add(self, low: float, high: float, is_integral: int) -> int:
        self.lows.append(low)
        self.highs.append(high)
        self.integral.append(is_integral)
        return len(self.lows) - 1

    def require(self, terms: Terms, *, low: float = -math.inf, high: float = math.inf) -> None:
        row = len(self.row_lows)
        self.entries += [(row, column, weight) for column, weight in terms]
        self.row_lows.append(low)
        self.row_highs.append(high)

    def least(self, column: int, *, time_limit_s: float) -> float | None:
        """The least value of a column; infinite if there is none, None if time ran out."""
        # Imported here: every test process imports this file, and one needs the solver.
        from scipy.optimize import Bounds, LinearConstraint, milp
        from scipy.sparse import csr_matrix

        rows, columns, weights = zip(*self.entries, strict=True)
        shape = (len(self.row_lows), len(self.lows))
        goal = np.zeros(len(self.lows))
        goal[column] = 1.0
        result = milp(
            goal,
            integrality=np.array(self.integral),
            bounds=Bounds(np.array(self.lows), np.array(self.highs)),
            constraints=LinearConstraint(
                csr_matrix((weights, (rows, columns)), shape=shape),
                np.array(self.row_lows),
                np.array(self.row_highs),
            ),
            options={"time_limit": time_limit_s, "mip_rel_gap": 1e-6},
        )
        if result.status == 0:
            return float(result.x[column])
        return math.inf if result.status == 2 else None


@dataclass(frozen=True, slots=True)
class _Hop:
    """One segment in one state: its effect on a drone, and the variable that chooses it."""

    column: int
    start: int
    end: int
    state: int
    reached: int
    seconds: float
    soc: float


def least_delivery_s(
    problem: Problem, *, most_segments: int, horizon_s: float, time_limit_s: float
) -> float | None:
    """The optimum within so many segments and seconds; infinite: none; None: time was too short."""
    if is_overweight(problem):
        return math.inf
    facts = read_facts(problem)
    if any(facts.station_closed) or any(facts.segment_closed):
        raise ValueError("this oracle cannot handle closures")
    if not facts.destinations and facts.start == facts.source:
        is_enough = facts.soc - facts.finish_soc[facts.start] >= facts.reserve - 1e-9
        return facts.pick_up_s if is_enough and facts.pick_up_s <= facts.latest_s else math.inf
    horizon_s = min(horizon_s, facts.latest_s)
    programme = _Programme()
    hops = _hops(programme, facts, most_segments)
    if not any(hop.reached == facts.served for layer in hops for hop in layer):
        return math.inf
    end = _physics(programme, facts, hops, horizon_s)
    return programme.least(end, time_limit_s=time_limit_s)


def _hops(programme: _Programme, facts: Facts, most_segments: int) -> list[list[_Hop]]:
    """One path through the layers from the start to a state in which everything is served."""
    first_state = 0 if facts.start == facts.source else facts.before
    places = {(facts.start, first_state)}
    layers: list[list[_Hop]] = []
    arriving: dict[tuple[int, int], list[int]] = {}
    for position in range(most_segments):
        layer = []
        for station, state in sorted(places):
            for segment, (start, end) in enumerate(facts.ends):
                reached = facts.after_landing_at(state, end)
                is_last = reached == facts.served
                if start != station or (is_last and math.isinf(facts.finish_soc[end])):
                    continue
                layer.append(
                    _Hop(
                        programme.binary(),
                        start,
                        end,
                        state,
                        reached,
                        facts.flight_s[state][segment]
                        + (0.0 if reached == state else facts.hand_over_s(state)),
                        facts.flight_soc[state][segment],
                    )
                )
        for place in places:
            leaving = [hop.column for hop in layer if (hop.start, hop.state) == place]
            terms = [(column, 1.0) for column in leaving]
            terms += [(column, -1.0) for column in arriving.get(place, [])]
            entering = 1.0 if position == 0 else 0.0
            programme.require(terms, low=entering, high=entering)
        layers.append(layer)
        arriving = {}
        for hop in layer:
            if hop.reached != facts.served:
                arriving.setdefault((hop.end, hop.reached), []).append(hop.column)
        places = set(arriving)
    for columns in arriving.values():
        programme.require([(column, 1.0) for column in columns], high=0.0)
    return layers


def _physics(programme: _Programme, facts: Facts, hops: list[list[_Hop]], horizon_s: float) -> int:
    """Times and charges along the path; the variable of the last arrival."""
    at_start = facts.pick_up_s if facts.start == facts.source else 0.0
    ready = programme.real(at_start, at_start)
    soc = programme.real(facts.soc, facts.soc)
    landed: int | None = None
    before: list[_Hop] = []
    for layer in hops:
        left_soc, left = _stop(programme, facts, ready, soc, before, landed, horizon_s)
        landed = programme.binary()
        arrived_soc = programme.real(facts.reserve, 1.0)
        arrived = programme.real(0.0, horizon_s)
        programme.require(
            [
                (arrived_soc, 1.0),
                (left_soc, -1.0),
                (landed, facts.stop_soc),
                *((hop.column, hop.soc) for hop in layer),
            ],
            low=0.0,
            high=0.0,
        )
        programme.require(
            [
                (arrived, 1.0),
                *((one, -1.0) for one in left),
                (landed, -facts.stop_s),
                *((hop.column, -hop.seconds) for hop in layer),
            ],
            low=0.0,
            high=0.0,
        )
        handing_over = [(hop.column, -1.0) for hop in layer if hop.reached != hop.state]
        programme.require([(landed, 1.0), *handing_over], low=0.0)
        last = [hop for hop in layer if hop.reached == facts.served]
        finishing = [(hop.column, -facts.finish_soc[hop.end]) for hop in last]
        programme.require([(arrived_soc, 1.0), *finishing], low=facts.reserve)
        ready, soc, before = arrived, arrived_soc, layer
    return ready


def _stop(
    programme: _Programme,
    facts: Facts,
    ready: int,
    soc: int,
    before: list[_Hop],
    landed: int | None,
    horizon_s: float,
) -> tuple[int, list[int]]:
    """Waiting and sessions; the charge left with, and the times whose sum is the departure."""
    left_soc = programme.real(facts.reserve, 1.0)
    is_charging = programme.binary()
    top = facts.curves[0][-1][1]
    programme.require([(left_soc, 1.0), (soc, -1.0)], low=0.0)
    programme.require([(left_soc, 1.0), (soc, -1.0), (is_charging, -1.0)], high=0.0)
    programme.require([(left_soc, 1.0), (is_charging, 1.0 - top)], high=1.0)
    if facts.is_full_policy:
        programme.require([(left_soc, 1.0), (is_charging, -top)], low=0.0)
    if landed is not None:
        programme.require([(is_charging, 1.0), (landed, -1.0)], high=0.0)
    here = {hop.end for hop in before} if landed is not None else {facts.start}
    # A full session stays on one pad; others may change pads, so the pads' free times are merged.
    free = facts.free if facts.is_full_policy else [_merged(pads) for pads in facts.free]
    slots = max((len(free[station]) for station in here), default=0)
    times, sessions, chosen = [ready], [], []
    for slot in range(slots):
        wait, session = (programme.real(0.0, horizon_s) for _ in range(2))
        windows = []
        for station in sorted(here):
            if slot >= len(free[station]):
                continue
            opens, closes = free[station][slot]
            window = programme.binary()
            windows.append((window, opens, min(closes, 3 * horizon_s)))
            if landed is not None:
                arriving = [(hop.column, -1.0) for hop in before if hop.end == station]
                programme.require([(window, 1.0), *arriving], high=0.0)
        start = [*((one, 1.0) for one in times), (wait, 1.0)]
        programme.require([*start, *((one, -opens) for one, opens, _ in windows)], low=0.0)
        programme.require(
            [
                *start,
                (session, 1.0),
                *((one, 3 * horizon_s - closes) for one, _, closes in windows),
            ],
            high=3 * horizon_s,
        )
        using = [(one, -2 * horizon_s) for one, _, _ in windows]
        programme.require([(wait, 1.0), (session, 1.0), *using], high=0.0)
        programme.require([*((one, 1.0) for one, _, _ in windows), (is_charging, -1.0)], high=0.0)
        times += [wait, session]
        sessions.append((session, 1.0))
        chosen += [(one, 1.0) for one, _, _ in windows]
    if facts.is_full_policy:
        programme.require([*chosen, (is_charging, -1.0)], high=0.0)
    programme.require([*chosen, (is_charging, -1.0)], low=0.0)
    _charge_curve(programme, facts, soc, left_soc, sessions, is_charging)
    return left_soc, times


def _charge_curve(
    programme: _Programme,
    facts: Facts,
    soc: int,
    left_soc: int,
    sessions: list[tuple[int, float]],
    is_charging: int,
) -> None:
    """The sessions last at least the curve's time from one charge to the other."""
    pieces = [
        (time_s, low, high, (end_s - time_s) / (high - low))
        for (time_s, low), (end_s, high) in pairwise(facts.curves[0])
    ]
    most_s = facts.curves[0][-1][0] + pieces[-1][3]
    end = programme.real(0.0, math.inf)
    for time_s, low, _, s_per_soc in pieces:
        programme.require([(end, 1.0), (left_soc, -s_per_soc)], low=time_s - s_per_soc * low)
    start: list[tuple[int, float]] = []
    parts: list[tuple[int, float]] = []
    choices: list[tuple[int, float]] = []
    for time_s, low, high, s_per_soc in pieces:
        choice, part = programme.binary(), programme.real(0.0, 1.0)
        programme.require([(part, 1.0), (choice, -low)], low=0.0)
        programme.require([(part, 1.0), (choice, -high)], high=0.0)
        start += [(choice, -(time_s - s_per_soc * low)), (part, -s_per_soc)]
        parts.append((part, 1.0))
        choices.append((choice, 1.0))
    programme.require([*choices, (is_charging, -1.0)], low=0.0, high=0.0)
    programme.require([*parts, (soc, -1.0)], high=0.0)
    # The sessions last at least end - start, when there are any.
    begun = [(column, -weight) for column, weight in start]
    programme.require([*sessions, (end, -1.0), *begun, (is_charging, -most_s)], low=-most_s)


def _merged(free: list[Interval]) -> list[Interval]:
    """The free times of all pads together: a drone may change pads within a stop."""
    merged: list[Interval] = []
    for opens, closes in sorted(free):
        if merged and opens <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(merged[-1][1], closes))
        else:
            merged.append((opens, closes))
    return merged
