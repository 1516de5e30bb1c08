"""Estimates of single trips, over all orders of their destinations (Held and Karp 1962)."""

import numpy as np

from skyway.planner.kernels.compiler import entrance
from skyway.planner.kernels.memory import Floats, int64

# Columns of an estimate: seconds in flight and with packages, need, joules.
SECONDS = 0
NEED = 1
JOULES = 2


@entrance
def estimate_trip(
    apart_m: Floats,
    s_per_m: Floats,
    j_per_m: Floats,
    stops: Floats,
    s_per_j: float,
    least: Floats,
    best: Floats,
    served_s: Floats,
) -> int:
    """Write the estimates of one trip; returns the last destination of the order of least need.

    Parameters
    ----------
    apart_m
        ``(k + 1, k)``, from destination to destination; the last row is from the pickup.
    s_per_m, j_per_m
        ``(2**k,)``, by the set of served destinations, with the packages that are still on board.
    stops
        Seconds and joules of one hand-over with its landing.
    s_per_j
        The least seconds on a pad for one joule.
    least
        ``(k, 3)``, written: by last destination, the least seconds, the least need and the least
        joules. They may belong to different orders.
    best
        ``(3,)``, written: seconds, need and joules of the order of least need.
    served_s
        ``(k,)``, written: when each destination is served in that order, in seconds of flight.
    """
    count = apart_m.shape[1]
    full = (1 << count) - 1
    table = np.full((full + 1, count, 3), np.inf)
    before = np.full((full + 1, count), int64(-1))
    for mask in range(full + 1):
        for here in range(-1, count):
            if (mask == 0) != (here < 0) or (here >= 0 and not mask >> here & 1):
                continue
            row = count if here < 0 else here
            for onward in range(count):
                if mask >> onward & 1:
                    continue
                seconds = apart_m[row, onward] * s_per_m[mask] + stops[0]
                joules = apart_m[row, onward] * j_per_m[mask] + stops[1]
                following = mask | 1 << onward
                if here < 0:
                    start_s, start_need, start_j = 0.0, 0.0, 0.0
                else:
                    start_s = table[mask, here, SECONDS]
                    start_need = table[mask, here, NEED]
                    start_j = table[mask, here, JOULES]
                cell = table[following, onward]
                cell[SECONDS] = min(cell[SECONDS], start_s + seconds)
                cell[JOULES] = min(cell[JOULES], start_j + joules)
                need = start_need + seconds + joules * s_per_j
                if need < cell[NEED]:
                    cell[NEED] = need
                    before[following, onward] = here
    least[:] = table[full]
    end = int64(np.argmin(table[full, :, NEED]))
    order = np.empty(count, np.int64)
    mask, here = full, end
    for number in range(count - 1, -1, -1):
        order[number] = here
        earlier = before[mask, here]
        mask, here = mask ^ 1 << here, earlier
    mask, row, seconds, joules = 0, count, 0.0, 0.0
    for number in range(count):
        onward = order[number]
        seconds += apart_m[row, onward] * s_per_m[mask] + stops[0]
        joules += apart_m[row, onward] * j_per_m[mask] + stops[1]
        served_s[onward] = seconds
        mask |= 1 << onward
        row = onward
    best[SECONDS], best[NEED], best[JOULES] = seconds, seconds + joules * s_per_j, joules
    return end
