"""The task of one trip, made from its row; equal to the task of `skyway.planner.exact_task`."""

from typing import NamedTuple

import numpy as np

from skyway.drone.flight import MASS_EXPONENT
from skyway.planner.kernels.bounds import fill_floors, fill_orders
from skyway.planner.kernels.closures import slack_s
from skyway.planner.kernels.compiler import array_kernel
from skyway.planner.kernels.handles import task_handle
from skyway.planner.kernels.memory import Floats, Ints, Longs, int64
from skyway.planner.kernels.records import Task, Terms, TripRows


class Drops(NamedTuple):
    """The places of a trip where packages are handed over, and last its source.

    `row` ``(k,)`` are the destinations, `mass_kg` ``(k,)`` the mass that each receives. The acts
    there begin between `from_s` and `until_s`, ``(k + 1,)``. `has_own` says that a package is for
    the source itself, `may_pass` that the trip has windows or that one of its places has opening
    hours.
    """

    row: Ints
    mass_kg: Floats
    from_s: Floats
    until_s: Floats
    load_kg: float
    has_own: bool
    may_pass: bool


@array_kernel
def drops_of(terms: Terms, trips: TripRows, trip: int) -> Drops:
    """The places of this trip, in the order in which its packages name them."""
    first, end = trips.package_offsets[trip], trips.package_offsets[trip + 1]
    row, mass_kg = np.empty(end - first, np.int32), np.zeros(end - first)
    from_s, until_s = np.full(end - first + 1, -np.inf), np.full(end - first + 1, np.inf)
    source = trips.source[trip]
    loading_s, own_from_s, own_until_s = 0.0, -np.inf, np.inf
    if not trips.on_board[trip]:
        loading_s, own_from_s = terms.loading_s, trips.pickup_from_s[trip]
        own_until_s = trips.pickup_until_s[trip] - loading_s
    may_pass = own_from_s > -np.inf or own_until_s < np.inf or terms.has_hours[source]
    has_own = False
    load_kg = 0.0
    count = 0
    for package in range(first, end):
        destination = trips.destination[package]
        load_kg += trips.mass_kg[package]
        may_pass = (
            may_pass
            or trips.from_s[package] > -np.inf
            or trips.until_s[package] < np.inf
            or terms.has_hours[destination]
        )
        if destination == source:
            has_own = True
            own_from_s = max(own_from_s, trips.from_s[package] - loading_s)
            takes_s = loading_s + terms.dropoff_s
            own_until_s = min(own_until_s, trips.until_s[package] - takes_s)
            continue
        number = 0
        while number < count and row[number] != destination:
            number += 1
        if number == count:
            row[count] = destination
            count += 1
        mass_kg[number] += trips.mass_kg[package]
        from_s[number] = max(from_s[number], trips.from_s[package])
        until_s[number] = min(until_s[number], trips.until_s[package] - terms.dropoff_s)
    from_s[count], until_s[count] = own_from_s, own_until_s
    return Drops(
        row[:count],
        mass_kg[:count],
        from_s[: count + 1],
        until_s[: count + 1],
        load_kg,
        has_own,
        may_pass,
    )


@array_kernel
def task_of_trip(
    terms: Terms, trips: TripRows, trip: int, drops: Drops, apart_m: Floats, is_closed: bool
) -> Task:
    """The handle of this trip's task; `apart_m` ``(k + 1, k)`` as in `fill_orders`.

    `is_closed` says that there are closures.
    """
    model, count = int64(trips.model[trip]), int64(drops.row.size)
    stop_s, stop_j, s_per_j = terms.stop_s[model], terms.stop_j[model], terms.s_per_j[model]
    s_per_m, j_per_m = _legs(terms, model, drops.mass_kg)
    needs_s = 0.0 if terms.recharges_fully else 1.0
    needs_s_per_j = 1.0 if terms.recharges_fully else s_per_j
    loading_s = 0.0 if trips.on_board[trip] else terms.loading_s
    if drops.has_own:
        loading_s += terms.dropoff_s
    finish_j = np.empty(count)
    flight_end_s, need_end = np.zeros(count), np.empty(count)
    for number in range(count):
        finish_j[number] = terms.to_pad_m[drops.row[number]] * j_per_m[-1]
        need_end[number] = needs_s_per_j * finish_j[number]
        if finish_j[number] == np.inf:
            flight_end_s[number] = np.inf
    required = np.zeros(count, np.int32)
    need_per_m = needs_s * s_per_m + needs_s_per_j * j_per_m
    # With windows the drone may land some time before it hands over.
    land_s, land_j = (0.0, 0.0) if drops.may_pass else (stop_s, stop_j)
    flight_after = np.empty((1 << count, count))
    need_after = np.empty((1 << count, count))
    least_s = fill_orders(
        apart_m, required, s_per_m, land_s + terms.dropoff_s, flight_end_s, flight_after
    )
    need_stop = needs_s * (land_s + terms.dropoff_s) + needs_s_per_j * land_j
    least_need = fill_orders(apart_m, required, need_per_m, need_stop, need_end, need_after)
    first_s, first_j = land_s + loading_s, land_j
    offsets, start_from_s, start_until_s = _starts(terms, trips, trip, drops, loading_s)
    last_start_s, floor_s, least_s_per_m = _window_bounds(
        drops,
        offsets,
        start_from_s,
        start_until_s,
        loading_s,
        s_per_m,
        apart_m,
        flight_after,
        least_s,
    )
    curves = (terms.curve_offsets.size - 1) // terms.battery_j.size
    curve_offsets = terms.curve_offsets[model * curves : (model + 1) * curves + 1]
    curve = slice(curve_offsets[0], curve_offsets[curves])
    source = trips.source[trip]
    finish_at_source_j = terms.to_pad_m[source] * j_per_m[-1] if count == 0 else 0.0
    # See `exact_task`: a drone with less on board is never slower, uses no more energy, and is
    # never too early.
    is_lighter_better = terms.speed_full_mps[model] <= terms.speed_empty_mps[model]
    is_timed = is_closed or drops.may_pass
    compares_masks = is_lighter_better and not is_timed
    lag_s_per_j = s_per_j if terms.recharges_fully and not is_timed else 0.0
    return task_handle(
        Task(
            drops.row.copy(),
            int64(source),
            int64(trips.start[trip]),
            s_per_m,
            j_per_m,
            s_per_m.copy(),
            need_per_m,
            flight_after,
            need_after,
            first_s + least_s,
            needs_s * first_s + needs_s_per_j * first_j + least_need,
            finish_j,
            finish_at_source_j,
            terms.curve_at,
            curve_offsets - curve_offsets[0],
            terms.curve_s[curve],
            terms.curve_j[curve],
            trips.start_s[trip],
            trips.soc[trip] * terms.battery_j[model],
            terms.reserve_j[model],
            terms.rounding_j[model],
            needs_s_per_j,
            lag_s_per_j,
            1.0,
            0.0,
            stop_s,
            stop_j,
            loading_s,
            terms.dropoff_s,
            trips.latest_s[trip] + slack_s(trips.latest_s[trip]),
            terms.recharges_fully,
            True,
            compares_masks,
            int64(0),
            1.0,
            drops.may_pass,
            offsets,
            start_from_s,
            start_until_s,
            last_start_s,
            floor_s,
            least_s_per_m,
        )
    )


@array_kernel
def _legs(terms: Terms, model: int, mass_kg: Floats) -> tuple[Floats, Floats]:
    """Seconds and joules per metre by mask, ``(2**k + 1,)``; see `exact_bounds.legs_of`."""
    masks = 1 << mass_kg.size
    s_per_m, j_per_m = np.empty(masks + 1), np.empty(masks + 1)
    slower_mps = terms.speed_full_mps[model] - terms.speed_empty_mps[model]
    for mask in range(masks + 1):
        load_kg = 0.0
        for number in range(mass_kg.size):
            if mask < masks and not mask >> number & 1:
                load_kg += mass_kg[number]
        share = load_kg / terms.payload_kg[model]
        s_per_m[mask] = 1.0 / (terms.speed_empty_mps[model] + share * slower_mps)
        ratio = 1.0 + load_kg / terms.empty_kg[model]
        j_per_m[mask] = terms.power_w[model] * ratio**MASS_EXPONENT * s_per_m[mask]
    return s_per_m, j_per_m


@array_kernel
def _starts(
    terms: Terms, trips: TripRows, trip: int, drops: Drops, loading_s: float
) -> tuple[Longs, Floats, Floats]:
    """When each act may begin, by destination and last the source; empty without windows."""
    count = int64(drops.row.size)
    if not drops.may_pass:
        return np.zeros(0, np.int64), np.zeros(0), np.zeros(0)
    offsets = np.zeros(count + 2, np.int64)
    room = count + 1
    for act in range(count + 1):
        row = drops.row[act] if act < count else trips.source[trip]
        room += terms.hours_offsets[row + 1] - terms.hours_offsets[row]
    from_s, until_s = np.empty(room), np.empty(room)
    used = 0
    for act in range(count + 1):
        row = drops.row[act] if act < count else trips.source[trip]
        takes_s = terms.dropoff_s if act < count else loading_s
        has_hours = terms.has_hours[row]
        # A drone with its packages on board may leave its source while the source is closed.
        if act == count and trips.on_board[trip] and not drops.has_own:
            has_hours = False
        first, end = terms.hours_offsets[row], terms.hours_offsets[row + 1]
        if not has_hours:
            first, end = int64(0), int64(1)
        for span in range(first, end):
            one_s, other_s = drops.from_s[act], drops.until_s[act]
            if has_hours:
                one_s = max(one_s, terms.open_from_s[span])
                other_s = min(other_s, terms.open_until_s[span] - takes_s)
            other_s += slack_s(other_s)
            if one_s <= other_s:
                from_s[used] = one_s
                until_s[used] = other_s
                used += 1
        offsets[act + 1] = used
    return offsets, from_s[:used], until_s[:used]


@array_kernel
def _window_bounds(
    drops: Drops,
    offsets: Longs,
    from_s: Floats,
    until_s: Floats,
    loading_s: float,
    s_per_m: Floats,
    apart_m: Floats,
    flight_after: Floats,
    least_s: float,
) -> tuple[Floats, Floats, Floats]:
    """The last starts, the floors and the least seconds per metre; empty without windows."""
    count = int64(drops.row.size)
    if not drops.may_pass:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    first_s, last_s = np.full(count + 1, np.inf), np.full(count + 1, -np.inf)
    for act in range(count + 1):
        if offsets[act] < offsets[act + 1]:
            first_s[act] = from_s[offsets[act]]
            last_s[act] = until_s[offsets[act + 1] - 1]
    least_s_per_m = s_per_m.copy()
    masks = 1 << count
    for number in range(count):
        for mask in range(masks):
            if not mask >> number & 1:
                least_s_per_m[mask] = min(least_s_per_m[mask], least_s_per_m[mask | 1 << number])
    least_s_per_m[masks] = min(s_per_m[masks], least_s_per_m[0])
    for number in range(count):
        if last_s[number] < np.inf:
            onward_s = loading_s + apart_m[count, number] * least_s_per_m[0]
            last_s[count] = min(last_s[count], last_s[number] - onward_s)
    floor_s = np.empty(masks + 1)
    fill_floors(flight_after, first_s[:count], floor_s)
    floor_s[masks] = max(first_s[count] + loading_s + least_s, floor_s[0])
    return last_s, floor_s, least_s_per_m
