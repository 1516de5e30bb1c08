"""A drone flies only steps that follow from one another."""

from typing import Any

import pytest
from skyway_drone_agent.instructions.mission_form import fault_in, heaviest_load_kg


def fault(made: Any, first_step: int = 1) -> str | None:
    return fault_in(made, first_step=first_step, packages=())


def test_a_whole_trip_has_no_fault(trip: Any) -> None:
    assert fault(trip) is None


def test_steps_begin_with_the_first_one_named(trip: Any) -> None:
    assert fault(trip, first_step=2) == "the steps do not begin with first_step 2"


def test_a_step_begins_where_the_one_before_ended(steps: Any) -> None:
    made = steps().fly("home", "shop", length_m=1, duration_s=1).wait("farm", duration_s=1).made

    assert fault(made) == "step 2 begins at farm, step 1 ends at shop"


def test_nothing_is_done_at_a_station_flown_over(steps: Any) -> None:
    made = (
        steps()
        .fly("home", "shop", length_m=1, duration_s=1, lands=False)
        .wait("shop", duration_s=1)
        .made
    )

    assert fault(made) == "step 2 needs a landing, step 1 flies over"


def test_the_last_step_is_on_the_ground(steps: Any) -> None:
    made = steps().fly("home", "shop", length_m=1, duration_s=1, lands=False).made

    assert fault(made) == "step 1 is the last and does not land"


def test_only_what_is_on_board_is_handed_over(steps: Any) -> None:
    made = steps().pick_up("home", p1=0.5).deliver("home", "p1").deliver("home", "p1").made

    assert fault(made) == "step 3 hands over ['p1'], not on board then"


def test_no_package_is_taken_on_twice(steps: Any) -> None:
    made = steps().pick_up("home", p1=0.5).pick_up("home", p1=0.5).made

    assert fault(made) == "step 2 takes on ['p1'] a second time"


def test_no_step_ends_before_it_starts(steps: Any) -> None:
    made = steps().wait("home", duration_s=-1).made

    assert fault(made) == "step 1 ends before it starts"


def test_the_heaviest_moment_counts(steps: Any) -> None:
    made = (
        steps()
        .pick_up("home", p1=0.5, p2=0.7)
        .deliver("home", "p2")
        .pick_up("home", p3=0.4)
        .bring_back("home", "p1", "p3")
        .made
    )

    assert heaviest_load_kg(made, ()) == pytest.approx(1.2)
