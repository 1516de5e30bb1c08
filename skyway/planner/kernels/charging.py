"""The charge curve as arrays, read both ways: joules over seconds on a pad."""

import numpy as np

from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.memory import Task


@kernel
def position_of(task: Task, level_j: float) -> float:
    """Where on the curve this level lies, seconds since empty; flat beyond both ends."""
    levels, seconds = task.curve_j, task.curve_s
    last = levels.size - 1
    if level_j >= levels[last]:
        return seconds[last]
    if level_j <= levels[0]:
        return seconds[0]
    after = 1
    while levels[after] < level_j:
        after += 1
    share = (level_j - levels[after - 1]) / (levels[after] - levels[after - 1])
    return seconds[after - 1] + share * (seconds[after] - seconds[after - 1])


@kernel
def level_at(task: Task, position_s: float) -> float:
    """The level at this position of the curve, joules; flat beyond both ends."""
    levels, seconds = task.curve_j, task.curve_s
    last = levels.size - 1
    if position_s >= seconds[last]:
        return levels[last]
    if position_s <= seconds[0]:
        return levels[0]
    after = 1
    while seconds[after] < position_s:
        after += 1
    share = (position_s - seconds[after - 1]) / (seconds[after] - seconds[after - 1])
    return levels[after - 1] + share * (levels[after] - levels[after - 1])


@kernel
def after_staying(
    task: Task, position: float, level: float, last_position: float, last_level: float, stay_s: float
) -> tuple[float, float]:
    """Position and level after staying longer on the last pad, as far as it can give."""
    if stay_s <= 0.0 or position >= last_position:
        return position, level
    if position + stay_s >= last_position:
        return last_position, last_level
    return position + stay_s, level_at(task, position + stay_s)


@kernel
def after_raising(
    task: Task, position: float, level: float, last_position: float, last_level: float, need_j: float
) -> tuple[float, float]:
    """Position and level after staying until the level is enough; position -1 if it never is."""
    if level >= need_j - task.rounding_j:
        return position, level
    if last_level < need_j - task.rounding_j:
        return -1.0, level
    if need_j >= last_level:
        return last_position, last_level
    return position_of(task, need_j), need_j


@kernel
def full_sessions_s(task: Task, missing_j: float) -> float:
    """The least time of sessions to the top that charge so many joules together.

    A session's time is concave in what it charges, as the curve is slowest at its top: fewest
    sessions from the reserve, and one for the rest, take the least.
    """
    if missing_j <= 0.0 or missing_j == np.inf:
        return max(missing_j, 0.0)
    top_j = task.curve_j[task.curve_j.size - 1]
    whole_j = top_j - task.reserve_j
    if whole_j <= 0.0:
        return np.inf
    sessions = np.floor(missing_j / whole_j)
    top_s = position_of(task, top_j)
    whole_s = top_s - position_of(task, task.reserve_j)
    return sessions * whole_s + top_s - position_of(task, top_j - missing_j + sessions * whole_j)
