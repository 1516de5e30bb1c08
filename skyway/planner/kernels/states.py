"""States: a place and a mask, with bounds of the remaining time."""

import numpy as np

from skyway.planner.kernels.bounds import note_bounds, note_last_arrival
from skyway.planner.kernels.charging import full_sessions_s
from skyway.planner.kernels.compiler import entrance, fetch_soon, kernel
from skyway.planner.kernels.memory import (
    FIRST_IN_AIR,
    FIRST_ON_GROUND,
    FULL,
    MOST,
    NONE,
    SEARCHED,
    SOONEST,
    STATE_MASK,
    STATE_PLACE,
    STATES,
    Memory,
    int64,
)
from skyway.planner.kernels.places import is_detour, slot_of
from skyway.planner.kernels.records import Search, Task

# The bits of a mask of 12 destinations and the approach.
_MASK_BITS = 13


@kernel
def state_of(search: Search, place: int, mask: int) -> int:
    """The state of this place and mask, noted with its bounds if new; -1 when full."""
    memory = search.memory
    slot = slot_of_state(memory, place, mask)
    if memory.state_table[slot] != 0:
        return memory.state_table[slot] - 1
    state = memory.counts[STATES]
    if state >= memory.state.shape[0]:
        memory.counts[FULL] = 1
        return NONE
    if not note_bounds(search, state, place, mask):
        return NONE
    if search.task.may_pass:
        note_last_arrival(search, state, place, mask)
    memory.state_table[slot] = state + 1
    memory.state[state, STATE_PLACE] = place
    memory.state[state, STATE_MASK] = mask
    memory.state[state, FIRST_ON_GROUND] = NONE
    memory.state[state, FIRST_IN_AIR] = NONE
    memory.state_best[state, SOONEST] = np.inf
    memory.state_best[state, MOST] = -np.inf
    if search.task.compares_masks:
        _note_ahead(search.task, memory, state, place, mask)
    memory.counts[STATES] = state + 1
    if memory.is_searched[place] == 0:
        memory.is_searched[place] = 1
        memory.counts[SEARCHED] += 1
    return state


@kernel
def _note_ahead(task: Task, memory: Memory, state: int, place: int, mask: int) -> None:
    """Note which states are one delivery ahead of a new state, and that it is ahead of others."""
    count = int64(task.destinations.size)
    if mask == int64(1) << count:
        return
    for number in range(count):
        other = memory.state_table[slot_of_state(memory, place, mask ^ int64(1) << number)] - 1
        is_delivered = (mask >> number) & 1 != 0
        memory.state_ahead[state, number] = NONE if is_delivered else other
        if is_delivered and other >= 0:
            memory.state_ahead[other, number] = state


@kernel
def slot_of_state(memory: Memory, place: int, mask: int) -> int:
    """The slot of this place and mask in the table of states; an empty one if it has no state."""
    slot = _first_slot(memory, place, mask)
    while memory.state_table[slot] != 0:
        state = memory.state_table[slot] - 1
        if memory.state[state, STATE_PLACE] == place and memory.state[state, STATE_MASK] == mask:
            break
        slot = (slot + 1) & (memory.state_table.size - 1)
    return slot


@kernel
def _first_slot(memory: Memory, place: int, mask: int) -> int:
    key = (int64(place) << _MASK_BITS) | mask
    return slot_of(key, memory.state_table.size)


@kernel
def fetch_states(memory: Memory, mask: int, first: int, count: int, detours: int) -> None:
    """Fetch the states with this mask at the ends of these arcs, and their latest labels.

    Each round reads what the round before has fetched. So the processor waits three times, and not
    three times for each arc.
    """
    for round_number in range(3):
        for number in range(count):
            if is_detour(detours, number):
                continue
            slot = _first_slot(memory, memory.arc_place[first + number], mask)
            if round_number == 0:
                fetch_soon(memory.state_table, slot)
                continue
            state = memory.state_table[slot] - 1
            if state < 0:
                continue
            if round_number == 1:
                fetch_soon(memory.state, state)
                fetch_soon(memory.state_bound, state)
            elif memory.state[state, FIRST_ON_GROUND] >= 0:
                fetch_soon(memory.label, memory.state[state, FIRST_ON_GROUND])


@entrance
def refill_state_table(memory: Memory) -> None:
    """Enter all states into an empty table."""
    for state in range(memory.counts[STATES]):
        place, mask = memory.state[state, STATE_PLACE], memory.state[state, STATE_MASK]
        memory.state_table[slot_of_state(memory, place, mask)] = state + 1


@kernel
def still_s(task: Task, memory: Memory, state: int, charge_j: float) -> float:
    """The least time until the last delivery, with this charge on board."""
    flight_s, need = memory.state_bound[state, 0], memory.state_bound[state, 1]
    usable_j = charge_j - task.reserve_j
    if task.recharges_fully:
        return flight_s + full_sessions_s(task, need - usable_j)
    return max(flight_s, need - usable_j * task.s_per_j)
