"""The grid programme's sweep over time, compiled: for every tick, who can be where with what."""

# Arrays have no types of ours here, and numba wants plain loops and positional arguments.
from typing import Any

import numba
import numpy as np

#: Modes of a drone at a station: passing over it, or standing on it.
AIR, LAND = 0, 1

#: No drone can be there; charges at an empty reserve may be a rounding below 0.
NOWHERE = -1.0


@numba.njit(cache=True)
def charged(curve: Any, soc: float, duration_s: float) -> Any:
    """The charge after so long on a pad."""
    last = len(curve) - 1
    if soc >= curve[last, 1]:
        return soc
    at_s = time_on_curve(curve, soc) + duration_s
    for point in range(1, last + 1):
        if at_s <= curve[point, 0]:
            share = (at_s - curve[point - 1, 0]) / (curve[point, 0] - curve[point - 1, 0])
            return curve[point - 1, 1] + share * (curve[point, 1] - curve[point - 1, 1])
    return curve[last, 1]


@numba.njit(cache=True)
def time_on_curve(curve: Any, soc: float) -> Any:
    """The moment of the charge curve at which this charge is reached."""
    for point in range(1, len(curve)):
        if soc <= curve[point, 1]:
            share = (soc - curve[point - 1, 1]) / (curve[point, 1] - curve[point - 1, 1])
            return curve[point - 1, 0] + share * (curve[point, 0] - curve[point - 1, 0])
    return curve[len(curve) - 1, 0]


@numba.njit(cache=True)
def is_closed(
    closed: Any, first: int, last: int, start_s: float, end_s: float, late_s: float
) -> Any:
    """Whether [start, end] meets a closed time; the start may be later (or earlier) by late_s."""
    for row in range(first, last):
        if start_s + late_s < closed[row, 1] - 1e-9 and end_s > closed[row, 0] + 1e-9:
            return True
    return False


@numba.njit(cache=True)
def periods_of(
    edges_s: Any, now_s: float, tick_s: float, late_s: float, is_early: bool, mode: int
) -> Any:
    """The first and the last period of the weather in which a drone may leave now.

    The early programme allows each in which the true moment may lie. The late programme allows one,
    and none if the true moment, which may be earlier in the air, may lie in two.
    """
    if is_early:
        first = np.searchsorted(edges_s, now_s - 1e-9, side="right")
        return first, np.searchsorted(edges_s, now_s + tick_s + late_s, side="right")
    last = np.searchsorted(edges_s, now_s + 1e-9, side="right")
    if mode == AIR and np.searchsorted(edges_s, now_s + late_s + 1e-9, side="right") != last:
        return last, last - 1
    return last, last


@numba.njit(cache=True)
def sweep(
    tick_s: float,
    horizon: int,
    is_early: bool,
    late_s: float,
    edge_of: Any,
    edge_to: Any,
    flight_ticks: Any,
    flight_soc: Any,
    edges_s: Any,
    next_state: Any,
    hand_over_ticks: Any,
    served: int,
    start_state: int,
    start: int,
    start_tick: int,
    soc: float,
    least_soc: float,
    stop_ticks: int,
    stop_soc: float,
    finish_soc: Any,
    curves: Any,
    is_full_policy: bool,
    pad_free: Any,
    window_of: Any,
    windows: Any,
    segment_closed_of: Any,
    segment_closed: Any,
    station_closed_of: Any,
    station_closed: Any,
    may_pass: bool,
    act_of: Any,
    start_of: Any,
    starts: Any,
) -> Any:
    """The first tick at which all is delivered (-1: never within the horizon), and the trail."""
    states, stations = next_state.shape
    best = np.full((horizon + 1, 2, states, stations), NOWHERE)
    trail = np.full((horizon + 1, 2, states, stations), -1, dtype=np.int64)
    finished, finished_from = -1, -1
    best[start_tick, LAND, start_state, start] = soc
    touch_s = stop_ticks * tick_s
    for tick in range(start_tick, horizon):
        if finished >= 0 and tick >= finished:
            break
        now_s = tick * tick_s
        for turn in range(states):
            # The state before the pickup comes first: loading may take no time.
            state = (turn + states - 1) % states
            for here in range(stations):
                curve = curves[here]
                standing = best[tick, LAND, state, here]
                code = ((tick * 2 + LAND) * states + state) * stations + here
                if standing > NOWHERE:
                    if is_full_policy and standing < curve[-1, 1]:
                        # A session to the top, within one free time of one pad.
                        takes_s = curve[-1, 0] - time_on_curve(curve, standing)
                        for window in range(window_of[here], window_of[here + 1]):
                            opens, closes = windows[window, 0], windows[window, 1]
                            may_start = now_s > opens - (tick_s if is_early else 1e-9)
                            if may_start and now_s + takes_s <= closes + 1e-9:
                                if is_early:
                                    ends = int(np.floor((now_s + takes_s) / tick_s + 1e-9))
                                else:
                                    ends = int(np.ceil((now_s + takes_s) / tick_s - 1e-9))
                                if ends == tick:
                                    standing = curve[-1, 1]
                                    best[tick, LAND, state, here] = standing
                                elif (
                                    ends <= horizon and best[ends, LAND, state, here] < curve[-1, 1]
                                ):
                                    best[ends, LAND, state, here] = curve[-1, 1]
                                    trail[ends, LAND, state, here] = code
                    waited = standing
                    if not is_full_policy and pad_free[here, tick]:
                        waited = charged(curve, standing, tick_s)
                    if best[tick + 1, LAND, state, here] < waited:
                        best[tick + 1, LAND, state, here] = waited
                        trail[tick + 1, LAND, state, here] = code
                act = act_of[state, here]
                if may_pass and act >= 0 and standing > NOWHERE:
                    # Hand over here and now, if some window is open.
                    is_open = False
                    for row in range(start_of[act], start_of[act + 1]):
                        begins = starts[row, 0] - (tick_s if is_early else 0.0)
                        is_open = is_open or (begins - 1e-9 <= now_s <= starts[row, 1] + 1e-9)
                    left = standing
                    if is_early and not is_full_policy and pad_free[here, tick]:
                        left = charged(curve, left, tick_s)
                    reached = next_state[state, here]
                    done = tick + hand_over_ticks[state]
                    if is_open and reached == served:
                        is_enough = left - finish_soc[here] >= least_soc
                        if is_enough and (finished < 0 or done < finished):
                            finished, finished_from = done, code
                    elif is_open and done <= horizon and best[done, LAND, reached, here] < left:
                        best[done, LAND, reached, here] = left
                        trail[done, LAND, reached, here] = code
                for mode in range(2):
                    leaving = best[tick, mode, state, here]
                    if leaving == NOWHERE:
                        continue
                    if mode == LAND and is_early and not is_full_policy and pad_free[here, tick]:
                        # The true moment lies up to a tick later, and it may charge until then.
                        leaving = charged(curve, leaving, tick_s)
                    code = ((tick * 2 + mode) * states + state) * stations + here
                    first, last = periods_of(edges_s, now_s, tick_s, late_s, is_early, mode)
                    for period in range(first, last + 1):
                        for edge in range(edge_of[here], edge_of[here + 1]):
                            there = edge_to[edge]
                            takes = flight_ticks[period, state, edge]
                            arrival = tick + takes
                            left = leaving - flight_soc[period, state, edge]
                            if left < least_soc or arrival + stop_ticks > horizon:
                                continue
                            shift_s = late_s if mode == AIR or is_early else 0.0
                            if is_closed(
                                segment_closed,
                                segment_closed_of[edge],
                                segment_closed_of[edge + 1],
                                now_s,
                                arrival * tick_s,
                                shift_s,
                            ):
                                continue
                            can_land = left - stop_soc >= least_soc and not is_closed(
                                station_closed,
                                station_closed_of[there],
                                station_closed_of[there + 1],
                                arrival * tick_s,
                                arrival * tick_s + touch_s + (0.0 if is_early else 2e-9),
                                late_s,
                            )
                            reached = next_state[state, there]
                            landed = arrival + stop_ticks
                            if reached == state or may_pass:
                                if best[arrival, AIR, state, there] < left:
                                    best[arrival, AIR, state, there] = left
                                    trail[arrival, AIR, state, there] = code
                                if can_land and best[landed, LAND, state, there] < left - stop_soc:
                                    best[landed, LAND, state, there] = left - stop_soc
                                    trail[landed, LAND, state, there] = code
                                continue
                            if not can_land:
                                continue
                            done = landed + hand_over_ticks[state]
                            left -= stop_soc
                            if reached == served:
                                is_enough = left - finish_soc[there] >= least_soc
                                if is_enough and (finished < 0 or done < finished):
                                    finished, finished_from = done, code
                            elif done <= horizon and best[done, LAND, reached, there] < left:
                                best[done, LAND, reached, there] = left
                                trail[done, LAND, reached, there] = code
    return finished, finished_from, best, trail
