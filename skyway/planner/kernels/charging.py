"""The charge curve as arrays, read both ways: joules over seconds on a pad."""

from typing import NamedTuple

import numpy as np

from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.memory import Floats
from skyway.planner.kernels.records import Task


class Charge(NamedTuple):
    """The level at which the drone leaves the last pad, and the highest level the pad could give.

    Levels in joules, each with its position on the charge curve in seconds.
    """

    position: float
    level: float
    last_position: float
    last_level: float


@kernel
def position_of(task: Task, level_j: float) -> float:
    """Where on the curve this level lies, seconds since empty; flat beyond both ends."""
    return _read(task.curve_j, task.curve_s, level_j)


@kernel
def level_at(task: Task, position_s: float) -> float:
    """The level at this position of the curve, joules; flat beyond both ends."""
    return _read(task.curve_s, task.curve_j, position_s)


@kernel
def _read(along: Floats, across: Floats, value: float) -> float:
    """The value that belongs to this one on a curve of straight pieces."""
    last = along.size - 1
    if value >= along[last]:
        return across[last]
    if value <= along[0]:
        return across[0]
    after = 1
    while along[after] < value:
        after += 1
    share = (value - along[after - 1]) / (along[after] - along[after - 1])
    return across[after - 1] + share * (across[after] - across[after - 1])


@kernel
def after_staying(task: Task, charge: Charge, stay_s: float) -> Charge:
    """The charge after a longer stay on the last pad, up to the highest level it can give."""
    if stay_s <= 0.0 or charge.position >= charge.last_position:
        return charge
    position = charge.position + stay_s
    if position >= charge.last_position:
        return Charge(
            charge.last_position, charge.last_level, charge.last_position, charge.last_level
        )
    level = level_at(task, position)
    return Charge(position, level, charge.last_position, charge.last_level)


@kernel
def until_left(task: Task, charge: Charge, stay_s: float) -> Charge:
    """The same charge, when the drone must leave the last pad after at most this many seconds."""
    most = after_staying(task, charge, stay_s)
    return Charge(charge.position, charge.level, most.position, most.level)


@kernel
def after_raising(task: Task, charge: Charge, need_j: float) -> Charge:
    """The charge after staying until this level; position -1 if the level is out of reach."""
    if charge.level >= need_j - task.rounding_j:
        return charge
    last_position, last_level = charge.last_position, charge.last_level
    if last_level < need_j - task.rounding_j:
        return Charge(-1.0, charge.level, last_position, last_level)
    if need_j >= last_level:
        return Charge(last_position, last_level, last_position, last_level)
    return Charge(position_of(task, need_j), need_j, last_position, last_level)


@kernel
def full_sessions_s(task: Task, missing_j: float) -> float:
    """The least time of sessions to the top that together charge this many joules.

    The time of a session is concave in its joules, as the curve is slowest at its top. So the
    least time has as few sessions as possible: whole ones from the reserve, and a last part.
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
