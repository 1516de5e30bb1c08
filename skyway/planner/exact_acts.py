"""The acts of the best plan that a search found, read from the labels that lead to the plan."""

import math
from typing import NamedTuple

import numpy as np

from skyway.planner.kernels.memory import (
    BEST,
    DETAIL,
    FLOWN,
    FLOWN_IN,
    HANDED_OVER,
    KIND,
    LEVEL,
    NONE,
    PARENT,
    SESSION,
    USED,
    Floats,
    Longs,
    Memory,
)


class Act(NamedTuple):
    """One act of a plan's drone: a kind of label.

    `segment` is the row of the segment flown, -1 without one; `level_j` the level with which it
    leaves the pad; `not_before_s` the moment before which the flight, landing or session may not
    begin; `period` the period of the weather in which the flight begins.
    """

    kind: int
    segment: int
    level_j: float
    not_before_s: float
    period: int


def acts_of(
    kind: Longs, segment: Longs, level_j: Floats, not_before_s: Floats, period: Longs | None = None
) -> list[Act]:
    """The acts in these columns; without periods there is no weather."""
    periods = np.zeros_like(kind) if period is None else period
    columns = (kind, segment, level_j, not_before_s, periods)
    return list(map(Act._make, zip(*(each.tolist() for each in columns), strict=True)))


def best_acts(memory: Memory, *, is_lazy: bool) -> list[Act] | None:
    """The acts of the best plan so far, from the start on; None without a plan.

    With lazy charging a session's own level is where it starts; where it ends is what the first
    label behind it that settled the matter says.
    """
    labels = _labels_of_best(memory)
    if not len(labels):
        return None
    links, values = memory.link[labels], memory.label[labels]
    kind = links[:, KIND]
    is_flown = (kind == FLOWN) | (kind == HANDED_OVER)
    segment, period = np.full(len(labels), NONE), np.zeros(len(labels), np.int64)
    segment[is_flown] = memory.arc_segment[links[is_flown, DETAIL]]
    if len(memory.period):
        period[is_flown] = memory.period[labels, FLOWN_IN][is_flown]
    level_j = np.full(len(labels), math.nan)
    (session,) = np.nonzero(kind == SESSION)
    level_j[session] = values[session, LEVEL]
    if is_lazy and len(session):
        left_with_j = level_j[session[1:]] + values[session[1:] - 1, USED]
        level_j[session] = np.append(left_with_j, values[-1, LEVEL])
    return acts_of(kind, segment, level_j, memory.not_before_s[labels], period)


def _labels_of_best(memory: Memory) -> Longs:
    """The labels that lead to the best plan so far, from the start on; empty without a plan."""
    parents = memory.link[:, PARENT]
    labels: list[int] = []
    label = memory.counts.item(BEST)
    while label >= 0:
        labels.append(label)
        label = parents.item(label)
    return np.array(labels[::-1], np.int64)
