"""Compares all flights of a plan with the segments, and all its sessions with reserved pads.

Written for `verify` alone, from docs/reference/planner-problem.md, so that a mistake of the search
is not repeated here. Steps are NumPy columns, so one query serves all steps of a plan.
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence, Set
from typing import TYPE_CHECKING, Final

import numpy as np

from skyway.delivery.plan import Recharge, Step
from skyway.ids import StationId
from skyway.network.network import MAX_PADS, Network
from skyway.planner.kernels.memory import Longs
from skyway.planner.problem import Problem
from skyway.planner.reservations import spans_at
from skyway.units import TIME_TOLERANCE_S

if TYPE_CHECKING:
    from skyway.planner.pad_book import PadBook

_MS_PER_S: Final = 1000
_MS_TOLERANCE: Final = TIME_TOLERANCE_S * _MS_PER_S

#: A start and an end, in whole milliseconds.
_Span = tuple[float, float]


def lengths_flown(network: Network, steps: Sequence[Step]) -> dict[int, float]:
    """The metres of each segment flown, by the number of the step; without missing segments."""
    row_of, leaving = network.row_of, network.outgoing
    flights = {
        number: step
        for number, step in enumerate(steps)
        if step.kind == "FLY" and step.from_id in row_of
    }
    number = np.array(list(flights), np.int64)
    start = np.array([row_of[step.from_id] for step in flights.values()], np.int64)
    end = np.array([row_of.get(step.to_id, -1) for step in flights.values()], np.int64)
    first = leaving.offsets[start]
    flight, entry = _entries(first, leaving.offsets[start + 1] - first)
    is_flown = leaving.station[entry] == end[flight]
    lengths_m = leaving.length_m[entry[is_flown]]
    return dict(zip(number[flight[is_flown]].tolist(), lengths_m.tolist(), strict=True))


def pad_clashes(
    problem: Problem, steps: Sequence[Step], *, booked: "PadBook | None"
) -> dict[int, _Span]:
    """The milliseconds of a reservation that a session overlaps, by the number of the step.

    Reservations are the problem's own, and the booked ones. Sessions without a clash are left out,
    and sessions on pads that no station can have.
    """
    sessions = {
        number: step
        for number, step in enumerate(steps)
        if step.kind == "RECHARGE"
        and step.station_id in problem.network.row_of
        and 0 <= step.pad < MAX_PADS
    }
    spans_ms = [_outward_ms(step.start_s, step.end_s) for step in sessions.values()]
    clashes: dict[int, _Span] = {}
    if booked is not None and len(booked.station):
        clashes = _booked_clashes(problem.network, sessions, spans_ms, booked)
    if problem.pad_reservations:
        held_ms = _held_ms(problem, {step.station_id for step in sessions.values()})
        for (number, step), (start_ms, end_ms) in zip(sessions.items(), spans_ms, strict=True):
            for held in held_ms.get((step.station_id, step.pad), ()):
                if start_ms < held[1] and held[0] < end_ms:
                    clashes[number] = held
                    break
    return clashes


def _held_ms(
    problem: Problem, stations: Set[StationId]
) -> Mapping[tuple[StationId, int], list[_Span]]:
    """The problem's own reservations of these stations, by pad."""
    held_ms: dict[tuple[StationId, int], list[_Span]] = defaultdict(list)
    for station_id, pad, start_s, end_s in spans_at(problem.pad_reservations, stations):
        held_ms[station_id, pad].append(_outward_ms(start_s, end_s))
    return held_ms


def _booked_clashes(
    network: Network,
    sessions: Mapping[int, Recharge],
    spans_ms: Iterable[_Span],
    booked: "PadBook",
) -> dict[int, _Span]:
    """A booked reservation that a session overlaps, by the number of the step."""
    rows = np.array([network.row_of[step.station_id] for step in sessions.values()], np.int32)
    pads = np.array([step.pad for step in sessions.values()], np.int64)
    starts_ms, ends_ms = np.array(spans_ms, np.float64).reshape(-1, 2).T + booked.zero_ms
    first = booked.station.searchsorted(rows)
    session, entry = _entries(first, booked.station.searchsorted(rows, "right") - first)
    is_on_pad = booked.pad[entry] == pads[session]
    session, entry = session[is_on_pad], entry[is_on_pad]
    is_overlap = (booked.start_ms[entry] < ends_ms[session]) & (
        booked.end_ms[entry] > starts_ms[session]
    )
    numbers = list(sessions)
    clashing = [numbers[one] for one in session[is_overlap].tolist()]
    from_ms = (booked.start_ms[entry[is_overlap]] - booked.zero_ms).tolist()
    until_ms = (booked.end_ms[entry[is_overlap]] - booked.zero_ms).tolist()
    return dict(zip(clashing, zip(from_ms, until_ms, strict=True), strict=True))


def _entries(first: Longs, count: Longs) -> tuple[Longs, Longs]:
    """The entries of all ranges: for each entry the number of its range, and the entry itself.

    A range has `count` entries, beginning with `first`. An example: with `first` [5, 9] and `count`
    [2, 1] the entries are 5, 6 and 9, and the numbers of their ranges are 0, 0 and 1.
    """
    number = np.repeat(np.arange(len(count)), count)
    before = np.cumsum(count) - count
    return number, np.arange(len(number)) + (first - before)[number]


def _outward_ms(start_s: float, end_s: float) -> _Span:
    """The span of whole milliseconds around this time, despite rounding of floats."""
    start_ms, end_ms = start_s * _MS_PER_S, end_s * _MS_PER_S
    return (
        math.floor(start_ms + _MS_TOLERANCE + math.ulp(start_ms)),
        end_ms if end_ms == math.inf else math.ceil(end_ms - _MS_TOLERANCE - math.ulp(end_ms)),
    )
