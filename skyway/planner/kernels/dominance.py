"""Dominance: whether one label of a state makes another label of that state useless."""

from skyway.planner.kernels.charging import level_at
from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.memory import (
    LAST_LEVEL,
    LAST_POSITION,
    LATEST,
    LEVEL,
    POSITION,
    TIME,
    USED,
    Floats,
)
from skyway.planner.kernels.records import Task

# Two moments closer than this are equal. So are two charges closer than this share of the
# tolerance of charges. The loss in a whole plan stays far below the planner's own tolerances.
SAME_S = 1e-10
SAME_SHARE = 1e-3


@kernel
def rank_s(task: Task, row: Floats) -> float:
    """The order of the labels of a list: no label dominates a label of a lower rank.

    The label's moment, where no label dominates an earlier one. Else the moment at which the drone
    would be charged to the top at the fastest rate, on a scale of its own.
    """
    top_j = task.curve_j[task.curve_j.size - 1]
    return row[TIME] - task.lag_s_per_j * min(row[LAST_LEVEL] - row[USED], top_j)


@kernel
def dominates(task: Task, one: Floats, other: Floats, missing_j: float) -> bool:
    """Whether `one` has at least the charge of `other` at each moment of `other`.

    Both are rows of `Memory.label`. If all pads have one concave charge curve, two labels cannot
    cross between the first and the last moment: it is enough to compare these two moments. On
    different curves the lead is least at one of these moments, or where the curve of `other` bends.

    If the drone of `other` must still charge `missing_j` on later pads, `one` may be later: by as
    much as charging the difference takes at the fastest rate. Its drone then takes the same pads,
    where it has as much charge no later. If sessions may end below the top, it leaves out those
    that are over when it arrives, so charging `missing_j` must take as long.
    """
    later_s = other[TIME] - one[TIME]
    if one[LATEST] < other[LATEST] - SAME_S:
        return False
    least_j = task.rounding_j * SAME_SHARE
    if later_s < -SAME_S:
        if missing_j <= task.rounding_j or rank_s(task, one) >= rank_s(task, other) - SAME_S:
            return False
        if not task.recharges_fully:
            difference_j = -later_s / task.lag_s_per_j
            if missing_j < difference_j + task.rounding_j:
                return False
            # Of labels that are exactly as good the first one stays, as without this rule.
            least_j -= difference_j + task.rounding_j
    lead_at_end_j = (one[LAST_LEVEL] - one[USED]) - (other[LAST_LEVEL] - other[USED])
    if lead_at_end_j < -least_j:
        return False
    position = one[POSITION] + max(later_s, 0.0)
    level = one[LAST_LEVEL]
    if position < one[LAST_POSITION]:
        level = one[LEVEL] if later_s <= 0.0 else level_at(task, position)
    if level - one[USED] < other[LEVEL] - other[USED] - least_j:
        return False
    position += other[LAST_POSITION] - other[POSITION]
    if position < one[LAST_POSITION]:
        level = level_at(task, position)
        if level - one[USED] < other[LAST_LEVEL] - other[USED] - least_j:
            return False
    return task.curve_at.size == 0 or _leads_at_bends(task, one, other, least_j)


@kernel
def _leads_at_bends(task: Task, one: Floats, other: Floats, least_j: float) -> bool:
    """Whether `one` has at least the charge of `other` wherever the curve of `other` bends."""
    begin = one[POSITION] + max(other[TIME] - one[TIME], 0.0)
    for point in range(task.curve_s.size):
        bend = task.curve_s[point]
        if not other[POSITION] < bend < other[LAST_POSITION]:
            continue
        position = begin + bend - other[POSITION]
        level = one[LAST_LEVEL]
        if position < one[LAST_POSITION]:
            level = level_at(task, position)
        if level - one[USED] < task.curve_j[point] - other[USED] - least_j:
            return False
    return True
