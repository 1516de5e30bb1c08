"""The steps of the order search, which move single trips, the last trips of drones, or requests.

Each step writes the new rows of one or two drones and returns their lengths. The first length is -1
if the step is not possible. The second length is 0 if both drones are the same.
"""

import numpy as np

from skyway.planner.kernels.compiler import array_kernel, kernel
from skyway.planner.kernels.fleet_costs import pool_of
from skyway.planner.kernels.fleet_records import FleetEstimates, Rows
from skyway.planner.kernels.memory import Longs, int64


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
def copy_row(row: Longs, length: int, into: Longs) -> int:
    """Copy the first trips of a row, as many as `length`; returns the length."""
    for number in range(length):
        into[number] = row[number]
    return length


@kernel
def relocate(
    rows: Rows, chance: Longs, one: int, other: int, first: Longs, second: Longs
) -> tuple[int, int]:
    """Move a trip of drone `one` to drone `other`, or within the drone; the new lengths."""
    at = draw(chance, rows.length[one])
    pool = rows.pool[one, at]
    one_length = _without(rows.pool[one], rows.length[one], at, first)
    if one == other:
        return _insert(first, one_length, draw(chance, one_length + 1), pool), int64(0)
    other_length = copy_row(rows.pool[other], rows.length[other], second)
    return one_length, _insert(second, other_length, draw(chance, other_length + 1), pool)


@kernel
def exchange(
    rows: Rows, chance: Longs, one: int, other: int, first: Longs, second: Longs
) -> tuple[int, int]:
    """Exchange two trips, of two drones or of one."""
    one_length = copy_row(rows.pool[one], rows.length[one], first)
    at = draw(chance, one_length)
    if one == other:
        there = draw(chance, one_length)
        first[at], first[there] = first[there], first[at]
        return one_length, int64(0)
    other_length = copy_row(rows.pool[other], rows.length[other], second)
    if other_length == 0:
        return int64(-1), int64(0)
    there = draw(chance, other_length)
    first[at], second[there] = second[there], first[at]
    return one_length, other_length


@kernel
def exchange_tails(
    rows: Rows, chance: Longs, one: int, other: int, first: Longs, second: Longs
) -> tuple[int, int]:
    """Exchange the last trips of two drones, from a place in each row on."""
    if one == other:
        return int64(-1), int64(0)
    one_length, other_length = rows.length[one], rows.length[other]
    at, there = draw(chance, one_length + 1), draw(chance, other_length + 1)
    copy_row(rows.pool[one], at, first)
    copy_row(rows.pool[other], there, second)
    for number in range(there, other_length):
        first[at + number - there] = rows.pool[other, number]
    for number in range(at, one_length):
        second[there + number - at] = rows.pool[one, number]
    return at + other_length - there, there + one_length - at


@array_kernel
def regroup(
    fleet: FleetEstimates,
    rows: Rows,
    chance: Longs,
    one: int,
    other: int,
    first: Longs,
    second: Longs,
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
        into, length = second, copy_row(rows.pool[other], rows.length[other], second)
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


@array_kernel
def _joined(fleet: FleetEstimates, pool: int, joiner: int) -> int:
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
