"""A problem as plain numbers; shares no code with the planner.

The rules are those of docs/reference/planner-problem.md.

States count what has happened to the packages: state `before` (the last one) while they are not on
board, else the bit set of destinations already served. Rows of stations and segments are the
network's own order.
"""

import math
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import NamedTuple

from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.network import Zone
from skyway.planner.problem import Problem, StationClosure

Interval = tuple[float, float]

#: How many times longer a flight over a segment takes that the weather closes: never in time.
_VERY_LONG = 1e6


@dataclass(frozen=True, slots=True)
class Facts:
    """The numbers; charges are shares of a full battery, times seconds."""

    names: list[str]
    #: Rows of the two ends of every segment.
    ends: list[tuple[int, int]]
    #: [state][segment] seconds and share of the battery of a flight.
    flight_s: list[list[float]]
    flight_soc: list[list[float]]
    #: Rows of the destinations apart from the source; bit i of a state is the i-th.
    destinations: list[int]
    source: int
    start: int
    soc: float
    reserve: float
    stop_s: float
    stop_soc: float
    #: The charge curve's points at the pads of each station, seconds and charge.
    curves: list[list[tuple[float, float]]]
    #: Seconds on the ground when packages are taken on; those for the source itself included.
    pick_up_s: float
    dropoff_s: float
    latest_s: float
    #: Charge that must be left above the reserve after a last delivery at each station.
    finish_soc: list[float]
    is_full_policy: bool
    #: Free times of every pad of every station, and closed times of stations and of segments.
    free: list[list[Interval]]
    station_closed: list[list[Interval]]
    segment_closed: list[list[Interval]]
    #: Whether the drone may pass a place where packages change hands; when each hand-over may
    #: begin, by destination, and last when loading may.
    may_pass: bool
    starts: list[list[Interval]]
    #: Where the weather's periods begin, and last where they end; [period][segment] how many times
    #: longer a flight takes and how many times the power it needs, with still air first and last.
    edges_s: list[float]
    longer: list[list[float]]
    harder: list[list[float]]

    @property
    def served(self) -> int:
        """The state in which everything is delivered."""
        return (1 << len(self.destinations)) - 1

    @property
    def before(self) -> int:
        """The state in which the packages are not on board."""
        return 1 << len(self.destinations)

    def after_landing_at(self, state: int, station: int) -> int:
        """The state after the hand-over that a landing here brings; the same if none."""
        if state == self.before:
            return 0 if station == self.source else state
        if station in self.destinations:
            return state | 1 << self.destinations.index(station)
        return state

    def act_at(self, state: int, station: int) -> int:
        """The destination handed over here, the number behind them for the pickup, or -1."""
        after = self.after_landing_at(state, station)
        if after == state:
            return -1
        if state == self.before:
            return len(self.destinations)
        return self.destinations.index(station)

    def hand_over_s(self, state: int) -> float:
        """Seconds that the hand-over out of this state takes."""
        return self.pick_up_s if state == self.before else self.dropoff_s


def is_overweight(problem: Problem) -> bool:
    """Whether the drone cannot lift all packages together."""
    mass_kg = math.fsum(package.mass_kg for package in problem.packages)
    return mass_kg > problem.drone.model.max_payload_kg + 1e-9


def read_facts(problem: Problem) -> Facts:
    """The numbers of this problem."""
    network, model = problem.network, problem.drone.model
    names = list(network.stations)
    row = {name: number for number, name in enumerate(names)}
    segments = list(network.segments)
    requested = dict.fromkeys(package.destination for package in problem.packages)
    destinations = [row[name] for name in requested if name != problem.source]
    loads = [
        sum(
            package.mass_kg
            for package in problem.packages
            if package.destination != problem.source
            and not state >> destinations.index(row[package.destination]) & 1
        )
        for state in range(1 << len(destinations))
    ]
    loads.append(0.0)

    def speed_mps(load_kg: float) -> float:
        gain_mps = model.speed_full_mps - model.speed_empty_mps
        return model.speed_empty_mps + gain_mps * load_kg / model.max_payload_kg

    def soc_per_s(load_kg: float) -> float:
        lifted = (model.empty_mass_kg + load_kg) / model.empty_mass_kg
        return float(model.power_empty_w * lifted**1.5 / model.battery_j)

    flight_s = [[segment.length_m / speed_mps(kg) for segment in segments] for kg in loads]
    weather = _weather(problem)
    return Facts(
        names=[str(name) for name in names],
        ends=[(row[segment.from_id], row[segment.to_id]) for segment in segments],
        flight_s=flight_s,
        flight_soc=[
            [soc_per_s(kg) * seconds for seconds in times]
            for kg, times in zip(loads, flight_s, strict=True)
        ],
        destinations=destinations,
        source=row[problem.source],
        start=row[problem.drone.station_id or problem.source],
        soc=problem.drone.soc,
        reserve=model.reserve_soc,
        stop_s=model.stop_s,
        stop_soc=model.stop_j / model.battery_j,
        curves=[_curve_at(problem, name) for name in names],
        pick_up_s=problem.loading_s + (problem.dropoff_s if problem.source in requested else 0.0),
        dropoff_s=problem.dropoff_s,
        latest_s=math.inf if problem.latest_delivery_s is None else problem.latest_delivery_s,
        finish_soc=_finish(problem, names, soc_per_s(0.0) / model.speed_empty_mps),
        is_full_policy=problem.recharge_policy == "full",
        free=[_free(problem, name) for name in names],
        station_closed=[_closed_station(problem, name) for name in names],
        segment_closed=[
            _closed_segment(problem, segment.from_id, segment.to_id) + closed
            for segment, closed in zip(segments, weather.closed, strict=True)
        ],
        edges_s=weather.edges_s,
        longer=weather.longer,
        harder=weather.harder,
        may_pass=_may_pass(problem),
        starts=[
            *(
                _within_hours(
                    problem, names[each], _hand_over_starts(problem, names[each]), problem.dropoff_s
                )
                for each in destinations
            ),
            _within_hours(
                problem,
                problem.source,
                _loading_starts(problem),
                problem.loading_s + (problem.dropoff_s if problem.source in requested else 0.0),
            ),
        ],
    )


class _Weather(NamedTuple):
    edges_s: list[float]
    longer: list[list[float]]
    harder: list[list[float]]
    closed: list[list[Interval]]


def _weather(problem: Problem) -> _Weather:
    """The weather by period and segment, from its JSON form."""
    segments = list(problem.network.segments)
    still, never = [1.0] * len(segments), [list[Interval]() for _ in segments]
    if problem.weather is None:
        return _Weather([], [still], [still], never)
    written = problem.model_dump(mode="json")["weather"]
    column = {tuple(ends): number for number, ends in enumerate(written["segments"])}
    longer, harder, closed = [still], [still], never
    for period in written["periods"]:
        longer.append(still.copy())
        harder.append(still.copy())
        for number, segment in enumerate(segments):
            place = column.get((segment.from_id, segment.to_id))
            if place is None:
                continue
            factor = period["time_factors"][place]
            if factor is None:
                end_s = math.inf if period["end_s"] is None else period["end_s"]
                closed[number].append((period["start_s"], end_s))
                longer[-1][number] = _VERY_LONG
            else:
                longer[-1][number] = factor
            harder[-1][number] = period["energy_factors"][place]
    edges_s = [one["start_s"] for one in written["periods"]]
    edges_s.append(written["periods"][-1]["end_s"] or math.inf)
    return _Weather(edges_s, [*longer, still], [*harder, still], closed)


def _may_pass(problem: Problem) -> bool:
    hours = problem.network.opening_hours
    if problem.source in hours or any(one.destination in hours for one in problem.packages):
        return True
    limits = [problem.pickup_not_before_s, problem.pickup_latest_s]
    limits += [limit for one in problem.packages for limit in (one.not_before_s, one.latest_s)]
    return any(limit is not None for limit in limits)


def _within_hours(
    problem: Problem, name: StationId, window: Interval, takes_s: float
) -> list[Interval]:
    """When an act may begin in this window, so that it is over before the station closes."""
    return [
        (max(window[0], opens), min(window[1], closes - takes_s))
        for opens, closes in _open(problem, name)
    ]


def _open(problem: Problem, name: StationId) -> list[Interval]:
    """When a station is open, on the day of the start; its hours are in UTC."""
    station, start_at = problem.network.stations[name], problem.start_at
    hours = station.properties.get("opening_hours")
    if hours is None or start_at is None:
        return [(-math.inf, math.inf)]
    midnight_s = -3600.0 * start_at.hour
    spans = hours["weekly"].get(
        ("mon", "tue", "wed", "thu", "fri", "sat", "sun")[start_at.weekday()]
    )
    times = []
    for span in spans or []:
        opens, closes = (
            midnight_s + 3600 * int(each[:2]) + 60 * int(each[3:]) for each in span.split("-")
        )
        times.append((opens, closes))
    return times


def _closed_hours(problem: Problem, name: StationId) -> list[Interval]:
    edges = [(-math.inf, -math.inf), *_open(problem, name), (math.inf, math.inf)]
    return [(end, start) for (_, end), (start, _) in pairwise(edges) if start > end]


def _hand_over_starts(problem: Problem, name: StationId) -> Interval:
    """When the packages for this station may begin to be handed over."""
    mine = [one for one in problem.packages if one.destination == name]
    begins = [one.not_before_s for one in mine if one.not_before_s is not None]
    ends = [one.latest_s - problem.dropoff_s for one in mine if one.latest_s is not None]
    return max(begins, default=-math.inf), min(ends, default=math.inf)


def _loading_starts(problem: Problem) -> Interval:
    """The same for loading; packages for the source are handed over as soon as it ends."""
    first, last = _hand_over_starts(problem, problem.source)
    first, last = first - problem.loading_s, last - problem.loading_s
    if problem.pickup_not_before_s is not None:
        first = max(first, problem.pickup_not_before_s)
    if problem.pickup_latest_s is not None:
        last = min(last, problem.pickup_latest_s - problem.loading_s)
    return first, last


def _finish(problem: Problem, names: list[StationId], soc_per_m: float) -> list[float]:
    """Floyd and Warshall, to the nearest station with a pad."""
    if problem.finish == "stay":
        return [0.0] * len(names)
    far = {(a, b): 0.0 if a == b else math.inf for a in names for b in names}
    for segment in problem.network.segments:
        far[segment.from_id, segment.to_id] = segment.length_m
    for via in names:
        for a in names:
            for b in names:
                far[a, b] = min(far[a, b], far[a, via] + far[via, b])
    with_pads = [name for name in names if _pads(problem, name) > 0]
    return [soc_per_m * min((far[a, b] for b in with_pads), default=math.inf) for a in names]


def _pads(problem: Problem, name: StationId) -> int:
    """How many pads of a station fit the drone: all or none."""
    station, connector = problem.network.stations[name], problem.drone.model.connector
    listed = station.properties.get("pad_connectors", [connector])
    return station.pads if connector is None or connector in listed else 0


def _free(problem: Problem, name: StationId) -> list[Interval]:
    """The free times of all pads, from 0 on; reservations hold whole milliseconds."""
    free = []
    for pad in range(_pads(problem, name)):
        taken = sorted(
            (
                math.floor(one.start_s * 1000 + 1e-3) / 1000,
                math.inf if one.end_s is None else math.ceil(one.end_s * 1000 - 1e-3) / 1000,
            )
            for one in problem.pad_reservations
            if one.station_id == name and one.pad == pad
        )
        edges = [(-math.inf, 0.0), *taken, (math.inf, math.inf)]
        until = 0.0
        for (_, end), (start, _) in pairwise(edges):
            until = max(until, end)
            if start > until:
                free.append((until, start))
    return free


def _curve_at(problem: Problem, name: StationId) -> list[tuple[float, float]]:
    """The model's curve, each piece stretched to the share of power that a pad surely has."""
    model, station = problem.drone.model, problem.network.stations[name]
    shares_w = [station.properties.get("pad_power_w", math.inf)]
    if "station_power_w" in station.properties:
        shares_w.append(station.properties["station_power_w"] / station.pads)
    curve = [(model.charge_curve[0].time_s, model.charge_curve[0].soc)]
    for before, after in pairwise(model.charge_curve):
        rise = after.soc - before.soc
        slow_s = rise * model.battery_j / min(shares_w)
        curve.append((curve[-1][0] + max(slow_s, after.time_s - before.time_s), after.soc))
    return curve


def _closed_station(problem: Problem, name: StationId) -> list[Interval]:
    here = problem.network.stations[name].position
    closed = [
        (one.start_s, math.inf if one.end_s is None else one.end_s)
        for one in problem.closures
        if isinstance(one, StationClosure) and one.station_id == name
    ]
    closed += _closed_hours(problem, name)
    return closed + [
        _active(problem, zone) for zone in problem.network.zones if _in_box(zone, here, here)
    ]


def _closed_segment(problem: Problem, start: StationId, end: StationId) -> list[Interval]:
    stations = problem.network.stations
    closed = [
        (one.start_s, math.inf if one.end_s is None else one.end_s)
        for one in problem.closures
        if not isinstance(one, StationClosure) and (one.from_id, one.to_id) == (start, end)
    ]
    return closed + [
        _active(problem, zone)
        for zone in problem.network.zones
        if _in_box(zone, stations[start].position, stations[end].position)
    ]


def _active(problem: Problem, zone: Zone) -> Interval:
    start_at = problem.start_at
    if start_at is None:
        return (-math.inf, math.inf)
    return (
        -math.inf if zone.active_from is None else (zone.active_from - start_at).total_seconds(),
        math.inf if zone.active_until is None else (zone.active_until - start_at).total_seconds(),
    )


def _in_box(zone: Zone, start: Position, end: Position) -> bool:
    """Whether the line meets the zone's box: clipped side by side, in exact fractions."""
    (ring,) = zone.rings
    if any(a[0] != b[0] and a[1] != b[1] for a, b in pairwise(ring)):
        raise ValueError(f"zone {zone.zone_id!r} is not a box")
    first, last = Fraction(0), Fraction(1)
    for axis in range(2):
        low = Fraction(min(corner[axis] for corner in ring))
        high = Fraction(max(corner[axis] for corner in ring))
        at, step = Fraction(start[axis]), Fraction(end[axis]) - Fraction(start[axis])
        if step == 0:
            if not low <= at <= high:
                return False
            continue
        enter, leave = sorted(((low - at) / step, (high - at) / step))
        first, last = max(first, enter), min(last, leave)
    return first <= last
