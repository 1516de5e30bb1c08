"""A situation and its windows as the arrays that the kernels read."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Literal, NamedTuple

import numpy as np

from skyway.drone.charging import fastest_s_per_soc
from skyway.drone.model import DroneModel
from skyway.ids import StationId
from skyway.network.network import Network
from skyway.planner.charge_curves import curves_of
from skyway.planner.closures import Closures, Interval
from skyway.planner.exact_bounds import Bound, Legs, bounds_of, legs_of
from skyway.planner.kernels.bounds import fill_floors
from skyway.planner.kernels.handles import handle_of
from skyway.planner.kernels.memory import Floats, Ints, Longs
from skyway.planner.kernels.records import Book, Closed, Task
from skyway.planner.pad_book import NO_RESERVATIONS, PadBook
from skyway.planner.situation import Situation
from skyway.units import CHARGE_TOLERANCE, time_tolerance_s


@dataclass(frozen=True, slots=True)
class Method:
    """How the exact search works; values other than the default measure the use of a part.

    `bound` guides the search: flying and charging, flying alone, or nothing. `dominance` leaves out
    labels that are no better than labels of the same set of delivered packages; "full" also
    compares with larger sets. `charging` is decided as late as possible, or on arrival at the pad:
    then it is the number of levels tried on each pad, and the plan is not proven to be the best.
    After `labels_before_haste` labels an unfinished search first looks for any plan.
    """

    bound: Literal["full", "flight", "none"] = "full"
    dominance: Literal["full", "same set", "none"] = "full"
    charging: Literal["lazy"] | int = "lazy"
    labels_before_haste: int = 1 << 14


def book_of(book: PadBook) -> Book:
    """A pad book as the kernels read it."""
    return Book(book.station, book.pad, book.start_ms, book.end_ms, book.zero_ms)


def book_handle(book: PadBook) -> Book:
    """The same behind its handle; all books without reservations share one handle."""
    return handle_of(book_of(book)) if len(book.station) else _empty_book()


@cache
def _empty_book() -> Book:
    return handle_of(book_of(NO_RESERVATIONS))


def closed_handle(situation: Situation) -> Closed:
    """All closures behind their handle; problems without closures share one handle."""
    first_station_key = len(situation.network.columns.length_m)
    if situation.closures.intervals():
        return handle_of(closed_of(situation))
    return _nothing_closed(first_station_key)


@lru_cache(maxsize=10)  # by the number of the network's segments
def _nothing_closed(first_station_key: int) -> Closed:
    nothing, never = np.empty(0, np.int64), np.empty(0)
    return handle_of(
        Closed(nothing, np.zeros(1, np.int64), never, never, first_station_key, is_two_way=True)
    )


def closed_of(situation: Situation) -> Closed:
    """All closures, by segment row and by station row counted on from the last segment."""
    network = situation.network
    first_station_key = len(network.columns.length_m)
    rows: dict[int, tuple[Interval, ...]] = {}
    for what, intervals in situation.closures.intervals().items():
        if isinstance(what, tuple):
            rows[_segment_row(network, *what)] = intervals
        else:
            rows[first_station_key + network.row_of[what]] = intervals
    keys = sorted(rows)
    flat = [interval for key in keys for interval in rows[key]]
    times_s = np.array(flat, np.float64).reshape(-1, 2)
    return Closed(
        np.array(keys, np.int64),
        np.cumsum([0, *(len(rows[key]) for key in keys)], dtype=np.int64),
        np.ascontiguousarray(times_s[:, 0]),
        np.ascontiguousarray(times_s[:, 1]),
        first_station_key,
        _is_two_way(situation.closures),
    )


def _is_two_way(closures: Closures) -> bool:
    """Whether all segments that are closed for good are closed for good in both directions."""
    return all(
        closures.is_closed_for_good(what[::-1])
        for what in closures.intervals()
        if isinstance(what, tuple) and closures.is_closed_for_good(what)
    )


def _segment_row(network: Network, from_id: StationId, to_id: StationId) -> int:
    outgoing, row = network.outgoing, network.row_of[from_id]
    leaving = slice(outgoing.offsets[row], outgoing.offsets[row + 1])
    place = int(np.flatnonzero(outgoing.station[leaving] == network.row_of[to_id])[0])
    return int(outgoing.segment[leaving][place])


def required_before(situation: Situation, order: Sequence[StationId] | None) -> Ints:
    """For each destination, as a mask, the destinations that must be delivered before it."""
    destinations = situation.destinations
    required = np.zeros(len(destinations), np.int32)
    delivered = 0
    for station_id in order or ():
        number = destinations.index(station_id)
        required[number] = delivered
        delivered |= 1 << number
    return required


def rounding_j(model: DroneModel) -> float:
    """Charges closer than this are equal, joules."""
    return CHARGE_TOLERANCE * model.battery_j


def latest_s(situation: Situation) -> float:
    """The latest moment of the last delivery, with the tolerance; inf without a limit."""
    limit_s = situation.problem.latest_delivery_s
    return math.inf if limit_s is None else limit_s + time_tolerance_s(limit_s) / 2


def task_of(
    situation: Situation,
    method: Method,
    *,
    required: Ints,
    apart_m: Floats,
    least_energy_factor: float,
    until_s: float,
    weight: float,
) -> Task:
    """The task as the kernels read it; `required` and `apart_m` as in `bounds_of`.

    `least_energy_factor` is the least that the weather multiplies the energy of flights by. Only
    plans that are over by `until_s` count.
    """
    problem, model = situation.problem, situation.model
    row_of = situation.network.row_of
    legs = legs_of(situation)
    least = Legs(legs.s_per_m, legs.j_per_m * least_energy_factor)
    flight, need = bounds_of(
        situation, least, guide=method.bound, required=required, apart_m=apart_m
    )
    loading_s = problem.loading.takes_s
    if situation.packages_for(problem.source):
        loading_s += problem.dropoff_s
    # Where the drone may stand at the source before it loads, the landing may be behind it.
    first_stop_s, first_stop_j = model.stop_s + loading_s, model.stop_j
    if situation.windows.may_pass:
        first_stop_s, first_stop_j = loading_s, 0.0
    stops_s = first_stop_s + len(situation.destinations) * (model.stop_s + problem.dropoff_s)
    windows = windows_of(situation, legs, flight, loading_s=loading_s, apart_m=apart_m)
    powers = situation.network.pad_powers
    curves = curves_of(model, powers)
    return Task(
        destinations=np.array([row_of[each] for each in situation.destinations], np.int32),
        source=row_of[problem.source],
        start=row_of[problem.start_station_id],
        s_per_m=legs.s_per_m,
        j_per_m=legs.j_per_m,
        flight_s_per_m=flight.per_m,
        need_per_m=need.per_m,
        flight_after=flight.after,
        need_after=need.after,
        approach_flight_after=flight.weights.of(first_stop_s, first_stop_j) + flight.least,
        approach_need_after=need.weights.of(first_stop_s, first_stop_j) + need.least,
        finish_j=np.array([situation.finish_j(each) for each in situation.destinations]),
        finish_j_at_source=0.0 if situation.destinations else situation.finish_j(problem.source),
        curve_at=powers.step,
        curve_offsets=curves.offsets,
        curve_s=curves.seconds,
        curve_j=curves.joules,
        begin_s=0.0,
        start_j=problem.drone.soc * model.battery_j,
        reserve_j=model.reserve_soc * model.battery_j,
        rounding_j=rounding_j(model),
        s_per_j=need.weights.per_joule,
        lag_s_per_j=_lag_s_per_j(situation, method),
        flown_j_of_need=_flown_j_of_need(flight, need),
        need_of_stops=need.weights.per_second * stops_s,
        stop_s=model.stop_s,
        stop_j=model.stop_j,
        loading_s=loading_s,
        dropoff_s=problem.dropoff_s,
        latest_s=min(latest_s(situation), until_s),
        recharges_fully=problem.recharge_policy == "full",
        prunes=method.dominance != "none",
        compares_masks=method.dominance == "full" and _compares_masks(situation),
        levels=0 if method.charging == "lazy" else method.charging,
        weight=weight,
        may_pass=situation.windows.may_pass,
        **windows._asdict(),
    )


def _lag_s_per_j(situation: Situation, method: Method) -> float:
    """How much later a label may be than a label that it dominates, for each joule more.

    That is 0 where the moment of a flight matters, and where sessions end at some levels only.
    """
    is_timed = situation.windows.may_pass or situation.closures.intervals()
    if method.charging != "lazy" or is_timed or situation.problem.weather is not None:
        return 0.0
    return fastest_s_per_soc(situation.fastest_model) / situation.model.battery_j


def _flown_j_of_need(flight: Bound, need: Bound) -> float:
    """The least joules flown for each unit of a need, apart from its stops."""
    if need.weights.per_second == 0.0:
        return 1.0
    if need.weights.per_joule == 0.0:
        return 0.0
    return float((1.0 - flight.per_m / need.per_m).min()) / need.weights.per_joule


def _compares_masks(situation: Situation) -> bool:
    """Whether a drone with less on board can follow all plans of a drone with more.

    A drone with less on board must not be slower or use more energy. With closures or windows it
    could be too early, so sets are not compared. With weather it must not be faster either: it
    would fly in another period.
    """
    model = situation.model
    return (
        model.speed_full_mps <= model.speed_empty_mps
        and (situation.problem.weather is None or model.speed_full_mps == model.speed_empty_mps)
        and not situation.windows.may_pass
        and not situation.closures.intervals()
    )


class WindowRows(NamedTuple):
    """The windows by destination, then the pickup; see `Task`."""

    start_offsets: Longs
    start_from_s: Floats
    start_until_s: Floats
    last_start_s: Floats
    floor_s: Floats
    least_s_per_m: Floats


_WITHOUT = WindowRows(
    np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0)
)


def windows_of(
    situation: Situation, legs: Legs, flight: Bound, *, loading_s: float, apart_m: Floats
) -> WindowRows:
    """The windows, and the bounds that follow from them; empty arrays without windows.

    Parameters
    ----------
    flight
        The bound by flight time alone.
    loading_s
        Seconds of loading, with the hand-over of packages for the source.
    apart_m
        As in `bounds_of`.
    """
    if not situation.windows.may_pass:
        return _WITHOUT
    places = (*situation.destinations, situation.problem.source)
    starts = [situation.windows.starts_at(place) for place in places]
    times_s = np.array([one for each in starts for one in each], np.float64).reshape(-1, 2)
    times_s[:, 1] += [time_tolerance_s(until_s) / 2 for until_s in times_s[:, 1]]
    offsets = np.cumsum([0, *(len(each) for each in starts)], dtype=np.int64)
    first_s = np.array([max(0.0, each[0][0]) if each else math.inf for each in starts])
    last_s = np.array(
        [
            times_s[end - 1, 1] if each else -math.inf
            for each, end in zip(starts, offsets[1:], strict=True)
        ]
    )
    least_s_per_m = _least_from_here(legs.s_per_m)
    for number, last_start_s in enumerate(last_s[:-1]):
        if last_start_s < math.inf:
            onward_s = loading_s + apart_m[-1, number] * least_s_per_m[0]
            last_s[-1] = min(last_s[-1], last_start_s - onward_s)
    floor_s = np.empty(len(legs.s_per_m))
    fill_floors(flight.after, first_s[:-1], floor_s)
    floor_s[-1] = max(first_s[-1] + loading_s + flight.least, floor_s[0])
    return WindowRows(
        offsets,
        np.ascontiguousarray(times_s[:, 0]),
        np.ascontiguousarray(times_s[:, 1]),
        last_s,
        floor_s,
        least_s_per_m,
    )


def _least_from_here(s_per_m: Floats) -> Floats:
    """The least seconds per metre by mask, now and after any of the deliveries still to come."""
    least = s_per_m.copy()
    masks = np.arange(len(s_per_m) - 1)
    for bit in range(len(masks).bit_length() - 1):
        without = masks[masks >> bit & 1 == 0]
        least[without] = np.minimum(least[without], least[without | 1 << bit])
    least[-1] = min(s_per_m[-1], least[0])
    return least
