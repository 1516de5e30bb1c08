"""The input of the kernels: the skyway, the task, closures, pad books; and columns of trips."""

from typing import NamedTuple

from skyway.planner.kernels.memory import Flags, Floats, Ints, Longs, Memory


class Skyway(NamedTuple):
    """The network's rows: segments by both ends, and the number of pads.

    `offsets` are ``(n_stations + 1,)`` int64, the rest ``(n_segments,)``; lengths in metres. With
    `is_two_way` each way back is as long as the way there. The fields after it are the hierarchy
    (see `skyway.planner.hierarchy`), empty without one.

    The last fields are the weather (see `skyway.planner.weather`), empty without one: the rows of
    its segments, the edges of its periods, its factors, and the least time factor of each segment
    in the periods in which the search may fly.
    """

    in_offsets: Longs
    in_station: Ints
    in_segment: Ints
    in_length: Floats
    out_offsets: Longs
    out_station: Ints
    out_segment: Ints
    out_length: Floats
    pads: Ints
    is_two_way: bool
    rank: Longs
    above_offsets: Longs
    above: Longs
    up_length: Floats
    down_length: Floats
    windy_segment: Longs
    edges_s: Floats
    time_factor: Floats
    energy_factor: Floats
    least_time_factor: Floats


class Closed(NamedTuple):
    """Closed times by segment row, and by station row counted on from the last segment.

    With `is_two_way` no segment is closed for good in one direction alone. `keys` are sorted; the
    closures of ``keys[i]`` are those from ``offsets[i]`` to ``offsets[i + 1]``, seconds, in any
    order, and may overlap.
    """

    keys: Longs
    offsets: Longs
    start_s: Floats
    end_s: Floats
    first_station_key: int
    is_two_way: bool


class Book(NamedTuple):
    """Reservations of pads, sorted by station row, pad and start; whole milliseconds.

    `zero_ms` is the moment of the plan's start on the book's own scale.
    """

    station: Ints
    pad: Ints
    start_ms: Longs
    end_ms: Longs
    zero_ms: int


class Task(NamedTuple):
    """The drone and its packages; energies in joules, moments in seconds.

    By mask, ``(2**k + 1,)``: `s_per_m` and `j_per_m` with the load; for the bounds `flight_s_per_m`
    and `need_per_m`. A need is counted in joules where sessions go on to the top, else in seconds
    of flying and of charging the flown joules. ``flight_after[mask, j]`` and ``need_after[mask,
    j]`` bound the time after destination j is reached, inf where j may not be next;
    `approach_flight_after` and `approach_need_after` the time after the source is reached.
    `s_per_j` is the least time to charge a joule. `lag_s_per_j` is this time where a label that is
    later may dominate, else 0 (see `dominance`). Each unit of a need above `need_of_stops` stands
    for at least `flown_j_of_need` joules.

    `begin_s` is the moment at which the drone stands at the start.

    `finish_j` is the energy that must remain above the reserve after the last delivery. The charge
    curves lead through `curve_s`, `curve_j`, the fastest first; rows ``curve_offsets[c]`` to
    ``curve_offsets[c + 1]`` are the points of curve c. All have the same levels. `curve_at` is by
    station row the curve at its pads, empty if there is one curve. `levels` are the levels tried on
    each pad, 0 if charging is decided as late as possible. `prunes` leaves out dominated labels,
    and `compares_masks` leaves out labels behind a drone that has delivered more (see `labels`).

    With `may_pass` the problem has windows. Destination j may be handed over from moments between
    `start_from_s` and `start_until_s`, rows ``start_offsets[j]`` to ``start_offsets[j + 1]``; the
    last destination is followed by the pickup. `last_start_s` ``(k + 1,)`` are the last of these
    moments. By mask, ``(2**k + 1,)``: `floor_s` is the least end of the last delivery that the
    windows allow, and `least_s_per_m` the least time for a metre from then on.
    """

    destinations: Ints
    source: int
    start: int
    s_per_m: Floats
    j_per_m: Floats
    flight_s_per_m: Floats
    need_per_m: Floats
    flight_after: Floats
    need_after: Floats
    approach_flight_after: float
    approach_need_after: float
    finish_j: Floats
    finish_j_at_source: float
    curve_at: Ints
    curve_offsets: Longs
    curve_s: Floats
    curve_j: Floats
    begin_s: float
    start_j: float
    reserve_j: float
    rounding_j: float
    s_per_j: float
    lag_s_per_j: float
    flown_j_of_need: float
    need_of_stops: float
    stop_s: float
    stop_j: float
    loading_s: float
    dropoff_s: float
    latest_s: float
    recharges_fully: bool
    prunes: bool
    compares_masks: bool
    levels: int
    weight: float
    may_pass: bool
    start_offsets: Longs
    start_from_s: Floats
    start_until_s: Floats
    last_start_s: Floats
    floor_s: Floats
    least_s_per_m: Floats


class Search(NamedTuple):
    """All data of one search, as handles.

    `given` and `known` are pad books: the problem's reservations, and the booked ones beside them.
    Python passes the handles one by one: numba would derive the type of a tuple at every call.
    """

    skyway: Skyway
    task: Task
    closed: Closed
    given: Book
    known: Book
    memory: Memory


class Terms(NamedTuple):
    """What many trips have in common; seconds count from the calendar's zero.

    By drone model, ``(n_models,)``: masses, the battery and its reserve, `rounding_j` within which
    charges are equal, speeds, the power of an empty drone, `stop_s` and `stop_j` of a landing, and
    `s_per_j`, the least time to charge a joule. The charge curves lie one after another, by
    `curve_offsets`: each model has as many, see `Task`.

    By station row: `to_pad_m` the least metres to a station with a pad, 0 where plans may end
    anywhere. The opening hours of a row are those from ``hours_offsets[row]`` to the next offset;
    `has_hours` says whether a row has any.
    """

    empty_kg: Floats
    payload_kg: Floats
    battery_j: Floats
    reserve_j: Floats
    rounding_j: Floats
    speed_empty_mps: Floats
    speed_full_mps: Floats
    power_w: Floats
    stop_s: Floats
    stop_j: Floats
    s_per_j: Floats
    curve_at: Ints
    curve_offsets: Longs
    curve_s: Floats
    curve_j: Floats
    to_pad_m: Floats
    has_hours: Flags
    hours_offsets: Longs
    open_from_s: Floats
    open_until_s: Floats
    loading_s: float
    dropoff_s: float
    recharges_fully: bool


class TripRows(NamedTuple):
    """Trips as columns, see `skyway.planner.trips.Trips`.

    `destination` and the fields after it are by package. The packages of a trip are those from
    ``package_offsets[trip]`` to the next offset.
    """

    start: Ints
    start_s: Floats
    soc: Floats
    model: Ints
    source: Ints
    on_board: Flags
    pickup_from_s: Floats
    pickup_until_s: Floats
    latest_s: Floats
    package_offsets: Longs
    destination: Ints
    mass_kg: Floats
    from_s: Floats
    until_s: Floats


class Found(NamedTuple):
    """The results for trips, which the kernels write one trip after another.

    `counts` ``(3,)``: how many trips are done, and how many rows of `act_link` and `session` are
    used. By trip: `outcome`, `end_row`, `labels`, `end_s`, `left_j`, `used_j`, and the
    offsets ``(n + 1,)`` of its acts and sessions. By package: `delivered_s`.

    `act_link` holds each act's kind and segment row, `act_value` its level and the moment before
    which it may not begin (see `skyway.planner.exact_itinerary.Act`). A row of `session` is a
    station row, a pad, and the start and end of the session in milliseconds.
    """

    counts: Longs
    outcome: Longs
    end_row: Longs
    labels: Longs
    end_s: Floats
    left_j: Floats
    used_j: Floats
    act_offsets: Longs
    session_offsets: Longs
    delivered_s: Floats
    act_link: Longs
    act_value: Floats
    session: Longs
