"""A search whose memory runs full again and again finds what one with ample memory finds."""

from collections.abc import Callable

import numpy as np
import pytest

from skyway.planner.airspace import Airspace
from skyway.planner.exact_memory import Room, enlarged, new_memory
from skyway.planner.exact_search import ExactSearch
from skyway.planner.exact_task import Method
from skyway.planner.hierarchy import Hierarchy
from skyway.planner.kernels.handles import handle_of
from skyway.planner.kernels.memory import LABELS, PLACES, WINDOWS
from skyway.planner.kernels.places import place_of
from skyway.planner.problem import Problem
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort, never
from tests.library.planner.oracles.instances import (
    make_busy_problem,
    make_problem,
    make_windy_problem,
)

_TINY = Room(places=2, arcs=4, windows=2, states=2, labels=2)
_MANY = 1 << 40


@pytest.mark.parametrize("make", [make_problem, make_busy_problem, make_windy_problem])
@pytest.mark.parametrize("is_prepared", [False, True])
def test_enlarging_in_the_middle_of_a_search_changes_nothing(
    make: Callable[[int], Problem], is_prepared: bool
) -> None:
    for seed in range(30):
        problem: Problem = make(seed)
        prepared = Hierarchy.of(problem.network) if is_prepared else None
        situation = Situation.of(problem, Airspace.of(problem.network), hierarchy=prepared)
        ample = ExactSearch(situation, method=Method())
        tiny = ExactSearch(situation, method=Method(), room=_TINY)

        endings = [each.run(Effort(never), most_labels=_MANY) for each in (ample, tiny)]

        assert endings[0] == endings[1], seed
        assert tiny.lower_bound_s == pytest.approx(ample.lower_bound_s, abs=1e-9), seed


def test_only_what_is_half_full_grows() -> None:
    memory = new_memory(1, room=Room(places=8, arcs=8, windows=8, states=8, labels=8))
    memory.counts[LABELS] = 4

    larger = enlarged(memory)

    assert (len(larger.label), len(larger.window_s), len(larger.row)) == (32, 8, 8)
    assert larger.window_s is memory.window_s


@pytest.mark.parametrize("labels", [8, 1 << 10, 1 << 16])
def test_a_label_lies_in_one_cache_line(labels: int) -> None:
    memory = new_memory(1, room=Room(places=8, arcs=8, windows=8, states=8, labels=labels))

    assert memory.label.strides[0] == 64
    assert memory.label.ctypes.data % 64 == 0


def test_the_memory_grows_when_one_station_needs_more_than_is_left() -> None:
    memory = new_memory(1, room=Room(places=8, arcs=8, windows=8, states=8, labels=8))
    memory.counts[WINDOWS] = 3

    assert len(enlarged(memory).window_s) == 32


def test_places_are_found_again_after_growing() -> None:
    memory = new_memory(1, room=Room(places=64, arcs=8, windows=8, states=8, labels=8))
    rows = np.random.default_rng(1).choice(1 << 30, 60, replace=False).tolist()
    places = [place_of(handle_of(memory), row) for row in rows]

    larger = enlarged(memory)

    assert places == list(range(60))
    assert [place_of(handle_of(larger), row) for row in rows] == places
    assert larger.counts[PLACES] == 60


def test_a_full_memory_has_no_room_for_another_place() -> None:
    memory = new_memory(1, room=Room(places=2, arcs=8, windows=8, states=8, labels=8))
    places = [place_of(handle_of(memory), row) for row in (5, 9, 11)]

    assert places == [0, 1, -1]
