"""Improves the order of a fleet's trips by simulated annealing over their estimates.

Ropke and Pisinger (2006) and Kirkpatrick, Gelatt and Vecchi (1983) describe the parts: single
trips and whole tails move between drones, requests join and leave shared trips, and a worse order
is accepted with a chance that falls.
"""

import numpy as np

from skyway.planner.kernels.compiler import entrance, kernel
from skyway.planner.kernels.fleet_records import Fleet, Rows
from skyway.planner.kernels.memory import Longs, int64

#: Bits of one request in a key: at most 2,000 requests, and 4 members.
KEY_BITS = 11


@kernel
def draw(chance: Longs, below: int) -> int:
    """A random number from 0 to `below` - 1 (xorshift, Marsaglia 2003); changes `chance`."""
    state = chance[0]
    state ^= (state << 13) & int64(0x7FFFFFFFFFFFFFFF)
    state ^= state >> 7
    state ^= (state << 17) & int64(0x7FFFFFFFFFFFFFFF)
    chance[0] = state
    return (state >> 11) % below


@kernel
def draw_share(chance: Longs) -> float:
    """A random number in [0, 1)."""
    return draw(chance, int64(1) << 40) / float(int64(1) << 40)


@kernel
def key_of(members: Longs) -> int:
    """One number for a set of requests in rising order."""
    key = int64(0)
    for member in members:
        if member >= 0:
            key = (key << KEY_BITS) | (member + 1)
    return key


@kernel
def pool_of(fleet: Fleet, members: Longs) -> int:
    """The pool of these requests, -1 if they may not share a trip."""
    key = key_of(members)
    place = np.searchsorted(fleet.key, key)
    if place < fleet.key.size and fleet.key[place] == key:
        return fleet.pool_of_key[place]
    return int64(-1)


@kernel
def cost_of_trip(fleet: Fleet, drone: int, pool: int, end_s: float) -> float:
    """What the requests of a trip cost that ends at this moment, without its energy."""
    kind, prices = fleet.kind[drone], fleet.prices
    cost = 0.0
    for number in range(fleet.members.shape[1]):
        request = fleet.members[pool, number]
        if request < 0:
            break
        served_s = end_s - fleet.early_s[kind, pool, number]
        cost += fleet.weight[request] * (
            prices[0] * (served_s - fleet.known_s[request])
            + prices[1] * max(0.0, served_s - fleet.due_s[request])
        )
        cost += prices[4] * max(0.0, served_s - fleet.latest_s[request])
        if fleet.planned[request] >= 0 and fleet.planned[request] != drone:
            cost += prices[3]
    return cost


@kernel
def cost_of_row(fleet: Fleet, drone: int, row: Longs, length: int) -> float:
    """What the trips of one drone cost, by their estimates."""
    kind = fleet.kind[drone]
    place = fleet.start[drone]
    flown_s = fleet.free_s[drone]
    charged_s = fleet.free_s[drone] - fleet.credit_s[drone]
    cost = 0.0
    for number in range(length):
        pool = row[number]
        source = fleet.source[pool]
        flown_s += fleet.approach[kind, place, source, 0]
        for member in fleet.members[pool]:
            if member >= 0:
                flown_s = max(flown_s, fleet.ready_s[member])
        flown_s += fleet.flight[kind, pool, 0]
        charged_s += fleet.approach[kind, place, source, 1] + fleet.flight[kind, pool, 1]
        cost += fleet.prices[2] * (
            fleet.approach[kind, place, source, 2] + fleet.flight[kind, pool, 2]
        )
        cost += cost_of_trip(fleet, drone, pool, max(flown_s, charged_s))
        flown_s += fleet.hand_over_s
        charged_s += fleet.hand_over_s
        place = fleet.end[kind, pool]
    return cost


@kernel
def _requests_in(fleet: Fleet, row: Longs, length: int) -> int:
    """How many requests the trips of a row serve."""
    count = int64(0)
    for number in range(length):
        for member in fleet.members[row[number]]:
            count += member >= 0
    return count


@kernel
def _shortage(fleet: Fleet, flown: Longs) -> float:
    """What it costs that providers fly too few requests."""
    missing = int64(0)
    for provider in range(flown.size):
        missing += max(int64(0), fleet.least_flown[provider] - flown[provider])
    return fleet.prices[5] * missing


@entrance
def price_rows(fleet: Fleet, rows: Rows) -> float:
    """Write what each drone's trips cost; returns the sum."""
    for drone in range(rows.length.size):
        rows.cost[drone] = cost_of_row(fleet, drone, rows.pool[drone], rows.length[drone])
    return rows.cost.sum()


@kernel
def _without(row: Longs, length: int, at: int, into: Longs) -> int:
    """Copy a row without one trip; returns the new length."""
    for number in range(at):
        into[number] = row[number]
    for number in range(at + 1, length):
        into[number - 1] = row[number]
    return length - 1


@kernel
def _insert(row: Longs, length: int, at: int, pool: int) -> int:
    """Put a trip into a row; returns the new length."""
    for number in range(length, at, -1):
        row[number] = row[number - 1]
    row[at] = pool
    return length + 1


@kernel
def _copy(row: Longs, length: int, into: Longs) -> int:
    for number in range(length):
        into[number] = row[number]
    return length


@kernel
def _relocate(
    rows: Rows, chance: Longs, one: int, other: int, first: Longs, second: Longs
) -> tuple[int, int]:
    """Move a trip of drone `one` to drone `other`, or within the drone; the new lengths."""
    at = draw(chance, rows.length[one])
    pool = rows.pool[one, at]
    one_length = _without(rows.pool[one], rows.length[one], at, first)
    if one == other:
        return _insert(first, one_length, draw(chance, one_length + 1), pool), int64(0)
    other_length = _copy(rows.pool[other], rows.length[other], second)
    return one_length, _insert(second, other_length, draw(chance, other_length + 1), pool)


@kernel
def _exchange(
    rows: Rows, chance: Longs, one: int, other: int, first: Longs, second: Longs
) -> tuple[int, int]:
    """Exchange two trips, of two drones or of one."""
    one_length = _copy(rows.pool[one], rows.length[one], first)
    at = draw(chance, one_length)
    if one == other:
        there = draw(chance, one_length)
        first[at], first[there] = first[there], first[at]
        return one_length, int64(0)
    other_length = _copy(rows.pool[other], rows.length[other], second)
    if other_length == 0:
        return int64(-1), int64(0)
    there = draw(chance, other_length)
    first[at], second[there] = second[there], first[at]
    return one_length, other_length


@kernel
def _exchange_tails(
    rows: Rows, chance: Longs, one: int, other: int, first: Longs, second: Longs
) -> tuple[int, int]:
    """Exchange all trips of two drones from some place on."""
    if one == other:
        return int64(-1), int64(0)
    one_length, other_length = rows.length[one], rows.length[other]
    at, there = draw(chance, one_length + 1), draw(chance, other_length + 1)
    _copy(rows.pool[one], at, first)
    _copy(rows.pool[other], there, second)
    for number in range(there, other_length):
        first[at + number - there] = rows.pool[other, number]
    for number in range(at, one_length):
        second[there + number - at] = rows.pool[one, number]
    return at + other_length - there, there + one_length - at


@kernel
def _regroup(
    fleet: Fleet, rows: Rows, chance: Longs, one: int, other: int, first: Longs, second: Longs
) -> tuple[int, int]:
    """Let a request leave its trip, to join another trip or to fly alone."""
    at = draw(chance, rows.length[one])
    pool = rows.pool[one, at]
    most = fleet.members.shape[1]
    count = int64(0)
    while count < most and fleet.members[pool, count] >= 0:
        count += 1
    leaver = fleet.members[pool, draw(chance, count)]
    one_length = _without(rows.pool[one], rows.length[one], at, first)
    if count > 1:
        kept = np.full(most, int64(-1))
        number = int64(0)
        for member in fleet.members[pool]:
            if member >= 0 and member != leaver:
                kept[number] = member
                number += 1
        left = pool_of(fleet, kept)
        if left < 0:
            return int64(-1), int64(0)
        one_length = _insert(first, one_length, at, left)
    if one == other:
        into, length = first, one_length
    else:
        into, length = second, _copy(rows.pool[other], rows.length[other], second)
    if count > 1 and (length == 0 or draw(chance, int64(2)) == 0):
        alone = np.full(most, int64(-1))
        alone[0] = leaver
        length = _insert(into, length, draw(chance, length + 1), pool_of(fleet, alone))
    else:
        if length == 0:
            return int64(-1), int64(0)
        there = draw(chance, length)
        joined = _joined(fleet, into[there], leaver)
        if joined < 0:
            return int64(-1), int64(0)
        into[there] = joined
    return (length, int64(0)) if one == other else (one_length, length)


@kernel
def _joined(fleet: Fleet, pool: int, joiner: int) -> int:
    """The pool of these requests and one more; -1 if they may not share a trip."""
    most = fleet.members.shape[1]
    if fleet.members[pool, most - 1] >= 0:
        return int64(-1)
    members = np.full(most, int64(-1))
    number = int64(0)
    is_in = False
    for member in fleet.members[pool]:
        if member < 0:
            break
        if not is_in and joiner < member:
            members[number] = joiner
            number += 1
            is_in = True
        members[number] = member
        number += 1
    if not is_in:
        members[number] = joiner
    return pool_of(fleet, members)


@entrance
def anneal(
    fleet: Fleet, rows: Rows, chance: Longs, steps: int, hot_s: float, cold_s: float
) -> float:
    """Improve the rows by so many steps; returns their cost, which ends at the best one found.

    Parameters
    ----------
    hot_s, cold_s
        A step that costs this much more is accepted with a chance of 1/e, at first and at last.
    """
    drones = rows.length.size
    first, second = np.empty(rows.pool.shape[1], np.int64), np.empty(rows.pool.shape[1], np.int64)
    best_pool, best_length, best_cost = rows.pool.copy(), rows.length.copy(), rows.cost.copy()
    flown = np.zeros(fleet.least_flown.size, np.int64)
    for drone in range(drones):
        flown[fleet.provider[drone]] += _requests_in(fleet, rows.pool[drone], rows.length[drone])
    shortage_s = _shortage(fleet, flown)
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
            lengths = _relocate(rows, chance, one, other, first, second)
        elif move == 1:
            lengths = _exchange(rows, chance, one, other, first, second)
        elif move == 2:
            lengths = _exchange_tails(rows, chance, one, other, first, second)
        else:
            lengths = _regroup(fleet, rows, chance, one, other, first, second)
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
            moved = _requests_in(fleet, rows.pool[one], rows.length[one])
            moved -= _requests_in(fleet, first, lengths[0])
            flown[fleet.provider[one]] -= moved
            flown[fleet.provider[other]] += moved
            more_s += _shortage(fleet, flown) - shortage_s
        if more_s > 0 and draw_share(chance) >= np.exp(-more_s / heat_s):
            flown[fleet.provider[one]] += moved
            flown[fleet.provider[other]] -= moved
            continue
        if moved != 0:
            shortage_s = _shortage(fleet, flown)
        rows.length[one] = _copy(first, lengths[0], rows.pool[one])
        rows.cost[one] = one_s
        if one != other:
            rows.length[other] = _copy(second, lengths[1], rows.pool[other])
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
