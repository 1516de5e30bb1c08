"""Improves the order of a fleet's trips by simulated annealing over their estimates.

Single trips move between drones, two drones exchange their last trips, and requests join and leave
shared trips (Ropke and Pisinger 2006). A worse order is accepted with a chance that falls
(Kirkpatrick, Gelatt and Vecchi 1983).
"""

import numpy as np

from skyway.planner.kernels.compiler import entrance
from skyway.planner.kernels.fleet_costs import cost_of_row, requests_in, shortage_cost
from skyway.planner.kernels.fleet_moves import (
    copy_row,
    draw,
    draw_share,
    exchange,
    exchange_tails,
    regroup,
    relocate,
)
from skyway.planner.kernels.fleet_records import FleetEstimates, Rows
from skyway.planner.kernels.memory import Longs, int64


@entrance
def price_rows(fleet: FleetEstimates, rows: Rows) -> float:
    """Write the cost of each drone's trips; returns the sum."""
    for drone in range(rows.length.size):
        rows.cost[drone] = cost_of_row(fleet, drone, rows.pool[drone], rows.length[drone])
    return rows.cost.sum()


@entrance
def anneal(
    fleet: FleetEstimates, rows: Rows, chance: Longs, steps: int, hot_s: float, cold_s: float
) -> float:
    """Improve the rows by this many steps; afterwards they are the best rows found. Their cost.

    Parameters
    ----------
    hot_s, cold_s
        A step that costs this much more is accepted with a chance of 1/e, at the beginning and at
        the end.
    """
    drones = rows.length.size
    first, second = np.empty(rows.pool.shape[1], np.int64), np.empty(rows.pool.shape[1], np.int64)
    best_pool, best_length, best_cost = rows.pool.copy(), rows.length.copy(), rows.cost.copy()
    flown = np.zeros(fleet.least_flown.size, np.int64)
    for drone in range(drones):
        flown[fleet.provider[drone]] += requests_in(fleet, rows.pool[drone], rows.length[drone])
    shortage_s = shortage_cost(fleet, flown)
    total_s = rows.cost.sum() + shortage_s
    best_s = total_s
    is_fair = fleet.least_flown.sum() > 0
    has_pools = fleet.members.shape[1] > 1 and fleet.key.size > fleet.weight.size
    moves = int64(4) if has_pools else int64(3)
    cooling = (cold_s / hot_s) ** (1.0 / max(1, steps))
    heat_s = hot_s
    for _ in range(steps):
        heat_s *= cooling
        one, other = draw(chance, drones), draw(chance, drones)
        if rows.length[one] == 0:
            continue
        move = draw(chance, moves)
        if move == 0:
            lengths = relocate(rows, chance, one, other, first, second)
        elif move == 1:
            lengths = exchange(rows, chance, one, other, first, second)
        elif move == 2:
            lengths = exchange_tails(rows, chance, one, other, first, second)
        else:
            lengths = regroup(fleet, rows, chance, one, other, first, second)
        if lengths[0] < 0:
            continue
        before_s = rows.cost[one]
        one_s = cost_of_row(fleet, one, first, lengths[0])
        other_s = 0.0
        if one != other:
            before_s += rows.cost[other]
            other_s = cost_of_row(fleet, other, second, lengths[1])
        more_s = one_s + other_s - before_s
        moved = int64(0)
        if is_fair and fleet.provider[one] != fleet.provider[other]:
            moved = requests_in(fleet, rows.pool[one], rows.length[one])
            moved -= requests_in(fleet, first, lengths[0])
            flown[fleet.provider[one]] -= moved
            flown[fleet.provider[other]] += moved
            more_s += shortage_cost(fleet, flown) - shortage_s
        if more_s > 0 and draw_share(chance) >= np.exp(-more_s / heat_s):
            flown[fleet.provider[one]] += moved
            flown[fleet.provider[other]] -= moved
            continue
        if moved != 0:
            shortage_s = shortage_cost(fleet, flown)
        rows.length[one] = copy_row(first, lengths[0], rows.pool[one])
        rows.cost[one] = one_s
        if one != other:
            rows.length[other] = copy_row(second, lengths[1], rows.pool[other])
            rows.cost[other] = other_s
        total_s += more_s
        if total_s < best_s - 1e-6:
            best_s = total_s
            best_pool[:] = rows.pool
            best_length[:] = rows.length
            best_cost[:] = rows.cost
    rows.pool[:] = best_pool
    rows.length[:] = best_length
    rows.cost[:] = best_cost
    return best_s
