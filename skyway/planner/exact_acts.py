"""The acts of a plan's drone, read from the labels that lead to the plan."""

import math
from dataclasses import dataclass
from typing import Final

from skyway.planner.kernels.memory import (
    BEST,
    DETAIL,
    FLOWN,
    HANDED_OVER,
    KIND,
    LEVEL,
    NOT_BEFORE,
    PARENT,
    SESSION,
    USED,
    Memory,
)

_NONE: Final = -1


@dataclass(frozen=True, slots=True)
class Act:
    """One act of a plan's drone: a kind of label.

    `segment` is the row of the segment flown, -1 without one; `level_j` the level with which it
    leaves the pad; `not_before_s` the moment before which the flight, landing or session may not
    begin.
    """

    kind: int
    segment: int
    level_j: float
    not_before_s: float


def best_acts(memory: Memory, *, is_lazy: bool) -> list[Act] | None:
    """The acts of the best plan so far, from the start on; None without a plan.

    With lazy charging a session's own level is where it starts; where it ends is what the first
    label behind it that settled the matter says.
    """
    label = int(memory.counts[BEST])
    if label == _NONE:
        return None
    links, values = memory.link, memory.label
    chain = []
    left_with_j = float(values[label, LEVEL])
    while label != _NONE:
        kind, parent = int(links[label, KIND]), int(links[label, PARENT])
        segment = _NONE
        level_j = math.nan
        if kind in (FLOWN, HANDED_OVER):
            segment = int(memory.arc_segment[links[label, DETAIL]])
        elif kind == SESSION:
            own_j = float(values[label, LEVEL])
            level_j = left_with_j if is_lazy else own_j
            left_with_j = own_j + float(values[parent, USED])
        chain.append(Act(kind, segment, level_j, float(values[label, NOT_BEFORE])))
        label = parent
    return chain[::-1]
