"""The least cost of one drone's trips for every set of requests that it may serve.

Dynamic programming over sets (Held and Karp 1962). A set is a number whose bit r says that request
r belongs to it. A label is a row of trips that serves a set and ends at a place. Its moments are no
later than those of a real row, and its cost is no higher.
"""

from typing import NamedTuple

import numpy as np

from skyway.planner.kernels.compiler import entrance, kernel
from skyway.planner.kernels.fleet_bound import Nodes, trip_cost
from skyway.planner.kernels.memory import Floats, Longs, int64

# Columns of a label: when the drone is free, this moment less what its charge covers, the cost, and
# the price of a second if the last hand-over is later, so that the drone charges before it. The
# price is 0 if the drone can charge after it.
FREE_S = 0
CHARGED_S = 1
COST = 2
DELAY = 3

# The most labels of a set and a place. One more is joined with another one: the label of both has
# the least of each column, and its last hand-over may be later for nothing. Our own choice.
MOST_LABELS = 6


class RowTask(NamedTuple):
    """The trips of one model of drone, and where and until when they may go.

    - `approach` ``(places, places, 3)``: seconds, need and joules of the empty flight, and `detour`
      the same if the drone passes a pad on its way.
    - `sources`: the place of each source.
    - By node: `bits`, its requests as a set; `end`, the number of its last place in `ends`;
      `delay`, see the columns of a label; `ready_s`, what the drone needs at the pickup to reach
      the next pad.
    - `ends`: the places where trips end.
    - `latest_s`, by request: no row serves a request later.
    """

    nodes: Nodes
    approach: Floats
    detour: Floats
    sources: Longs
    bits: Longs
    end: Longs
    delay: Floats
    ready_s: Floats
    ends: Longs
    latest_s: Floats


@entrance
def least_rows(
    task: RowTask,
    place: int,
    free_s: float,
    charged_s: float,
    left: int,
    most: float,
    label: Floats,
    count: Longs,
    least: Floats,
) -> None:
    """Write the least cost of each set in `left`, ``(sets,)``; inf for a set without a row.

    Parameters
    ----------
    place, free_s, charged_s
        Where and when the drone is free, and this moment less what its charge covers.
    most
        Rows that cost more are left out.
    label, count
        Room for labels ``(sets, ends, MOST_LABELS, 4)`` and their numbers ``(sets, ends)``.
    """
    bits, ends = task.bits, task.ends
    count[: left + 1] = 0
    least[:] = np.inf
    least[0] = 0.0
    start = np.array([free_s, charged_s, 0.0, np.inf])
    for node in range(bits.size):
        if bits[node] & ~left == 0:
            _add_trip(task, node, place, start, most, label[bits[node]], count[bits[node]])
    for served in range(1, left + 1):
        if served & ~left != 0:
            continue
        for end in range(ends.size):
            for number in range(count[served, end]):
                row = label[served, end, number]
                least[served] = min(least[served], row[COST])
                for node in range(bits.size):
                    if bits[node] & (served | ~left) == 0:
                        both = served | bits[node]
                        _add_trip(task, node, ends[end], row, most, label[both], count[both])


@kernel
def _add_trip(
    task: RowTask,
    node: int,
    place: int,
    row: Floats,
    most: float,
    labels: Floats,
    counts: Longs,
) -> None:
    """Add the rows that end with this trip.

    If the charge does not reach, the drone charges on its way to the pickup, or before its last
    hand-over.
    """
    source = task.sources[task.nodes.source[node]]
    away, detour = task.approach[place, source], task.detour[place, source]
    missing_s = row[CHARGED_S] + away[1] - away[0] + task.ready_s[node] - row[FREE_S]
    if missing_s <= 0.0 or detour[0] <= away[0]:
        _add_row(task, node, row, 0.0, away, most, labels, counts)
    else:
        _add_row(task, node, row, 0.0, detour, most, labels, counts)
        _add_row(task, node, row, missing_s, away, most, labels, counts)


@kernel
def _add_row(
    task: RowTask,
    node: int,
    row: Floats,
    later_s: float,
    away: Floats,
    most: float,
    labels: Floats,
    counts: Longs,
) -> None:
    """Add the row that flies to this trip's pickup, so much later than it could."""
    nodes = task.nodes
    charged_s = row[CHARGED_S] + away[1]
    free_s = max(row[FREE_S] + later_s + away[0], charged_s + task.ready_s[node])
    cost = row[COST] + nodes.rates[2] * away[2] + trip_cost(nodes, node, free_s, charged_s)
    if later_s > 0.0:
        cost += later_s * row[DELAY]
    if cost > most:
        return
    end_s = 0.0
    for number in range(nodes.member.shape[1]):
        request = nodes.member[node, number]
        if request < 0:
            break
        served = nodes.served[node, number]
        served_s = max(free_s + served[0], charged_s + served[1])
        if served_s > task.latest_s[request]:
            return
        end_s = max(end_s, served_s)
    end = task.end[node]
    counts[end] = _with_label(
        labels[end],
        counts[end],
        end_s + nodes.hand_over_s,
        charged_s + nodes.least[node, 1] + nodes.hand_over_s,
        cost,
        task.delay[node],
    )


@kernel
def _with_label(
    labels: Floats, count: int, free_s: float, charged_s: float, cost: float, delay: float
) -> int:
    """Keep this label, if no other one is as good; how many labels there are now.

    A label is as good as another one if it is no worse when it waits for the other one's moment.
    """
    for number in range(count):
        label = labels[number]
        if (
            label[FREE_S] <= free_s
            and label[CHARGED_S] <= charged_s
            and label[COST] + (free_s - label[FREE_S]) * label[DELAY] <= cost
            and label[DELAY] <= delay
        ):
            return count
    kept = int64(0)
    for number in range(count):
        label = labels[number]
        if (
            label[FREE_S] < free_s
            or label[CHARGED_S] < charged_s
            or label[COST] < cost + (label[FREE_S] - free_s) * delay
            or label[DELAY] < delay
        ):
            for column in range(label.size):
                labels[kept, column] = label[column]
            kept += 1
    if kept == labels.shape[0]:
        kept -= 1
        label = labels[kept]
        free_s = min(free_s, label[FREE_S])
        charged_s = min(charged_s, label[CHARGED_S])
        cost = min(cost, label[COST])
        delay = 0.0
    labels[kept, FREE_S] = free_s
    labels[kept, CHARGED_S] = charged_s
    labels[kept, COST] = cost
    labels[kept, DELAY] = delay
    return kept + 1
