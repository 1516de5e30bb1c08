"""Stations that the search has met, and the segments between them."""

import numpy as np

from skyway.planner.kernels.closures import is_closed_for_good
from skyway.planner.kernels.compiler import entrance, kernel
from skyway.planner.kernels.memory import (
    ARCS,
    DETAIL,
    FLOWN,
    FULL,
    INWARD,
    KIND,
    NONE,
    OUTWARD,
    PARENT,
    PLACES,
    STATE,
    STATE_PLACE,
    Memory,
    int64,
)
from skyway.planner.kernels.records import Closed, Search, Skyway
from skyway.planner.kernels.weather import column_of, has_weather, least_time_factor

# Knuth's multiplicative hashing: 2**32 divided by the golden ratio.
_GOLDEN = 2654435769

# Of the segments that leave a station only so many may be detours: their bits fit into an int64.
_MOST_BITS = 62


@kernel
def slot_of(key: int, slots: int) -> int:
    """The first slot to look at for a key; the number of slots is a power of two."""
    # A Python integer: without compilation an integer of 32 bits would overflow.
    return ((int(key) * _GOLDEN) >> 13) & (slots - 1)


@entrance
def place_of(memory: Memory, row: int) -> int:
    """The place of this station row, noted if it is new; -1 when the memory is full."""
    slot = slot_of(row, memory.table.size)
    while memory.table[slot] != 0:
        place = memory.table[slot] - 1
        if memory.row[place] == row:
            return place
        slot = (slot + 1) & (memory.table.size - 1)
    place = memory.counts[PLACES]
    if place >= memory.row.size:
        memory.counts[FULL] = 1
        return NONE
    memory.table[slot] = place + 1
    memory.row[place] = row
    memory.arc_first[place, 0] = -1
    memory.arc_first[place, 1] = -1
    memory.window_first[place] = -1
    memory.is_searched[place] = 0
    for tree in range(memory.radius.size):
        memory.distance[tree, place] = np.inf
        memory.tree_slot[tree, place] = -1
    memory.counts[PLACES] = place + 1
    return place


@entrance
def refill_table(memory: Memory) -> None:
    """Enter all places into an empty table."""
    for place in range(memory.counts[PLACES]):
        slot = slot_of(memory.row[place], memory.table.size)
        while memory.table[slot] != 0:
            slot = (slot + 1) & (memory.table.size - 1)
        memory.table[slot] = place + 1


@kernel
def arcs_of(skyway: Skyway, closed: Closed, memory: Memory, place: int, direction: int) -> int:
    """The first arc that arrives at or leaves this place; -1 when the memory is full.

    Segments closed for good are left out. With weather, arcs that arrive have their least length.
    """
    first = memory.arc_first[place, direction]
    if first >= 0:
        return first
    row = memory.row[place]
    if direction == INWARD:
        offsets, stations = skyway.in_offsets, skyway.in_station
        segments, lengths = skyway.in_segment, skyway.in_length
    else:
        offsets, stations = skyway.out_offsets, skyway.out_station
        segments, lengths = skyway.out_segment, skyway.out_length
    first = memory.counts[ARCS]
    if first + offsets[row + 1] - offsets[row] > memory.arc_place.size:
        memory.counts[FULL] = 1
        return NONE
    end = first
    for index in range(offsets[row], offsets[row + 1]):
        if closed.keys.size > 0 and is_closed_for_good(closed, int64(segments[index])):
            continue
        length_m = lengths[index]
        if has_weather(skyway):
            column = column_of(skyway, int64(segments[index]))
            least = least_time_factor(skyway, column)
            if least == np.inf:
                continue
            memory.arc_column[end] = column
            if direction == INWARD:
                length_m *= least
        other = place_of(memory, int64(stations[index]))
        if other < 0:
            return NONE
        memory.arc_place[end] = other
        memory.arc_segment[end] = segments[index]
        memory.arc_length[end] = length_m
        memory.arc_detours[end] = NONE
        end += 1
    memory.arc_first[place, direction] = first
    memory.arc_count[place, direction] = end - first
    memory.counts[ARCS] = end
    return first


@kernel
def detours_after(search: Search, label: int) -> int:
    """The segments that leave the label's station and are detours, as bits in their order.

    The drone has just flown over this station. A segment is a detour if it leads back, or to a
    station that one segment from the station before reaches on a way that is not longer. Another
    label then dominates the label after the detour. Where the moment of a flight matters, no
    segment is a detour.
    """
    task, memory = search.task, search.memory
    if (
        memory.link[label, KIND] != FLOWN
        or not task.prunes
        or task.may_pass
        or search.closed.keys.size > 0
        or has_weather(search.skyway)
    ):
        return int64(0)
    arc = memory.link[label, DETAIL]
    if memory.arc_detours[arc] < 0:
        before = memory.link[memory.link[label, PARENT], STATE]
        memory.arc_detours[arc] = _detours_of(memory, arc, memory.state[before, STATE_PLACE])
    return memory.arc_detours[arc]


@kernel
def is_detour(detours: int, number: int) -> bool:
    """Whether the segment with this number is one of the detours."""
    return number < _MOST_BITS and (detours >> number) & 1 != 0


@kernel
def _detours_of(memory: Memory, arc: int, place: int) -> int:
    """The detours after this arc, which leaves this place."""
    reached = memory.arc_place[arc]
    first, first_onward = memory.arc_first[place, OUTWARD], memory.arc_first[reached, OUTWARD]
    end = first + memory.arc_count[place, OUTWARD]
    detours = int64(0)
    for number in range(min(memory.arc_count[reached, OUTWARD], _MOST_BITS)):
        onward = first_onward + number
        target = memory.arc_place[onward]
        length_m = memory.arc_length[arc] + memory.arc_length[onward]
        is_useless = target == place
        for direct in range(first, end):
            if memory.arc_place[direct] == target and memory.arc_length[direct] <= length_m:
                is_useless = True
        if is_useless:
            detours |= int64(1) << number
    return detours
