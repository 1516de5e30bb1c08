"""The charge curves as arrays, read both ways: joules over seconds on a pad.

A network's pads may give different powers, so a drone has a curve for each power. The curves lie
one after another along one axis of positions. A position belongs to one curve, and the difference
of two positions of a curve is a time.
"""

from typing import NamedTuple

import numpy as np

from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.memory import Floats, int64
from skyway.planner.kernels.records import Task

# Pieces of two curves are equally fast if their times differ by less than this share.
_SAME_PACE = 1e-9


class Charge(NamedTuple):
    """The level at which the drone leaves the last pad, and the highest level the pad could give.

    Levels in joules, each with its position on the last pad's charge curve in seconds.
    """

    position: float
    level: float
    last_position: float
    last_level: float


@kernel
def curve_at(task: Task, row: int) -> int:
    """The number of the charge curve at the pads of this station row."""
    return int64(task.curve_at[row]) if task.curve_at.size > 0 else int64(0)


@kernel
def _curve_with(task: Task, position_s: float) -> int:
    """The number of the charge curve to which this position belongs."""
    curve = int64(0)
    while position_s > end_of_curve_s(task, curve):
        curve += 1
    return curve


@kernel
def end_of_curve_s(task: Task, curve: int) -> float:
    """The last position of this curve, where it reaches the top."""
    return task.curve_s[task.curve_offsets[curve + 1] - 1]


@kernel
def position_of(task: Task, curve: int, level_j: float) -> float:
    """Where on this curve the level lies; flat beyond both ends."""
    first, end = task.curve_offsets[curve], task.curve_offsets[curve + 1]
    return _read(task.curve_j, task.curve_s, level_j, first, end)


@kernel
def level_at(task: Task, position_s: float) -> float:
    """The level at this position, joules; flat beyond both ends of the curves."""
    return _read(task.curve_s, task.curve_j, position_s, int64(0), int64(task.curve_s.size))


@kernel
def _read(along: Floats, across: Floats, value: float, first: int, end: int) -> float:
    """The value that belongs to this one on a curve of straight pieces, rows `first` to `end`."""
    last = end - 1
    if value >= along[last]:
        return across[last]
    if value <= along[first]:
        return across[first]
    after = first + 1
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
    position = position_of(task, _curve_with(task, last_position), need_j)
    return Charge(position, need_j, last_position, last_level)


@kernel
def worth_staying_s(task: Task, charge: Charge, curve: int) -> float:
    """How much longer to stay on the last pad before a session on this curve; 0 if that is as fast.

    The last pad may give more power than the next one. Then each joule is charged sooner there, up
    to the level from which the drone itself sets the pace on both pads. Above this level the next
    pad is as fast, because the drone arrives there with less.
    """
    if task.curve_at.size == 0 or charge.position >= charge.last_position:
        return 0.0
    last = _curve_with(task, charge.last_position)
    if last >= curve:
        return 0.0
    here, there = task.curve_offsets[last], task.curve_offsets[curve]
    end = task.curve_offsets[last + 1] - 1
    while here < end:
        fast_s = task.curve_s[here + 1] - task.curve_s[here]
        slow_s = task.curve_s[there + 1] - task.curve_s[there]
        if slow_s <= fast_s * (1.0 + _SAME_PACE):
            break
        here, there = here + 1, there + 1
    return max(0.0, min(task.curve_s[here], charge.last_position) - charge.position)


@kernel
def full_sessions_s(task: Task, missing_j: float) -> float:
    """The least time of sessions to the top that together charge this many joules.

    On the first curve, which is the fastest.

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
    top_s = position_of(task, int64(0), top_j)
    whole_s = top_s - position_of(task, int64(0), task.reserve_j)
    last_j = top_j - missing_j + sessions * whole_j
    return sessions * whole_s + top_s - position_of(task, int64(0), last_j)
