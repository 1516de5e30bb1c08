"""`compose_many` finds the same results as `compose` finds for each trip alone."""

import contextlib
import gc
import math
from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba.core.runtime import _nrt_python, rtsys

from skyway.delivery.plan import Recharge
from skyway.errors import InvalidProblem
from skyway.ids import StationId
from skyway.planner import compose
from skyway.planner.compose_many import compose_many
from skyway.planner.kernels.memory import Longs
from skyway.planner.pad_book import PadBook
from skyway.planner.pad_ledger import PadIsTaken, PadLedger
from skyway.planner.planned_trips import PlannedTrips, TripOutcome
from skyway.planner.problem import Problem
from skyway.planner.stop import OutOfTime
from skyway.planner.trip_terms import TripTerms
from skyway.planner.trips import Trips
from skyway.planner.verify import PlanRejected, verify
from tests.library.planner.oracles.instances import (
    make_busy_problem,
    make_problem,
    make_problem_with_connectors,
    make_problem_with_hours,
    make_problem_with_powers,
    make_stormy_problem,
    make_windowed_problem,
)
from tests.library.planner.oracles.touching import make_touching_problem
from tests.long_cases import sampled

_OUTCOME_OF = {
    None: TripOutcome.PROVEN,
    "OVERWEIGHT": TripOutcome.OVERWEIGHT,
    "DESTINATION_UNREACHABLE": TripOutcome.UNREACHABLE,
}


def ledger_of(problem: Problem, *, begins_s: float) -> PadLedger:
    """The ledger whose zero is this much earlier than the problem's zero."""
    start_at = problem.start_at
    terms = TripTerms.of(
        problem.network,
        [problem.drone.model],
        start_at=None if start_at is None else start_at - timedelta(seconds=begins_s),
        closures=[
            one.model_copy(
                update={
                    "start_s": one.start_s + begins_s,
                    "end_s": None if one.end_s is None else one.end_s + begins_s,
                }
            )
            for one in problem.closures
        ],
        recharge_policy=problem.recharge_policy,
        finish=problem.finish,
        loading_s=problem.loading_s,
        dropoff_s=problem.dropoff_s,
    )
    book = PadBook.of(problem.network, problem.pad_reservations)
    return PadLedger(terms, book.seen_from(-round(1000 * begins_s)))


def trips_of(problem: Problem, *, begins_s: float, count: int = 1) -> Trips:
    """The problem's trip so many times, beginning at this moment."""
    row_of, packages = problem.network.row_of, problem.packages

    def after(moment_s: float | None, otherwise_s: float) -> float:
        return otherwise_s if moment_s is None else begins_s + moment_s

    return Trips.of(
        start_row=row_of[problem.start_station_id],
        start_s=begins_s,
        soc=problem.drone.soc,
        source_row=row_of[problem.source],
        are_on_board=problem.are_on_board,
        pickup_not_before_s=after(problem.pickup_not_before_s, -math.inf),
        pickup_latest_s=after(problem.pickup_latest_s, math.inf),
        latest_delivery_s=after(problem.latest_delivery_s, math.inf),
        package_offsets=np.arange(count + 1) * len(packages),
        destination_row=[row_of[one.destination] for one in packages] * count,
        mass_kg=[one.mass_kg for one in packages] * count,
        not_before_s=[after(one.not_before_s, -math.inf) for one in packages] * count,
        latest_s=[after(one.latest_s, math.inf) for one in packages] * count,
    )


@pytest.mark.parametrize("begins_s", sampled([7_200.0, 0.0], every=2))
@pytest.mark.parametrize(
    "make",
    [
        make_problem,
        make_busy_problem,
        make_windowed_problem,
        make_problem_with_hours,
        make_problem_with_powers,
        make_problem_with_connectors,
        make_stormy_problem,
        make_touching_problem,
    ],
)
def test_a_trip_ends_when_the_plan_of_its_problem_ends(
    make: Callable[..., Problem], begins_s: float
) -> None:
    for seed in range(25):
        problem = make(seed, label_limit=None, time_limit_s=None, strategy="exact")

        planned = compose_many(
            trips_of(problem, begins_s=begins_s), ledger_of(problem, begins_s=begins_s)
        )

        disagreement = differs(problem, planned, begins_s)
        assert disagreement is None, (seed, disagreement)


@pytest.mark.parametrize("seed", range(20))
def test_packages_on_board_are_not_loaded_and_have_no_pickup_window(seed: int) -> None:
    made = {"label_limit": None, "time_limit_s": None, "strategy": "exact", "are_on_board": True}
    window = {"pickup_not_before_s": 500.0, "pickup_latest_s": 800.0, "loading_s": 60.0}
    problem = make_windowed_problem(seed, **made, **window)
    none = dict.fromkeys(["pickup_not_before_s", "pickup_latest_s"])
    unloaded = make_windowed_problem(seed, **made, **none, loading_s=0.0)

    plan = compose(problem)
    planned = compose_many(
        trips_of(problem, begins_s=7_200.0), ledger_of(problem, begins_s=7_200.0)
    )

    expected = compose(unloaded)
    assert (plan.steps, plan.infeasibility) == (expected.steps, expected.infeasibility)
    assert verify(unloaded, plan) == verify(problem, expected) == ()
    assert differs(unloaded, planned, 7_200.0) is None


def differs(problem: Problem, planned: PlannedTrips, begins_s: float) -> str | None:
    """How the first trip differs from the problem's plan, or None."""
    plan = compose(problem)
    code = plan.infeasibility.code if plan.infeasibility else None
    outcome = TripOutcome(int(planned.outcome[0]))
    expected = _OUTCOME_OF.get(code, TripOutcome.NO_PLAN)
    if outcome != expected and not {outcome, expected} <= {
        TripOutcome.NO_PLAN,
        TripOutcome.UNREACHABLE,
    }:
        return f"{outcome.name} instead of {code}"
    if plan.delivery_time_s is None:
        return None
    ended_s = float(planned.end_s[0]) - begins_s
    if not math.isclose(ended_s, plan.delivery_time_s, abs_tol=2e-6, rel_tol=1e-9):
        return f"ends at {ended_s} instead of {plan.delivery_time_s}"
    own = planned.plan(0)  # verified
    delivered_s = {int(one.package_id): one.delivered_s for one in own.deliveries}
    columns_s = (planned.delivered_s - begins_s).tolist()
    if not all(abs(columns_s[number] - at_s) < 2e-6 for number, at_s in delivered_s.items()):
        return f"delivers at {columns_s} instead of {delivered_s}"
    if own.energy_j is None or not math.isclose(planned.energy_j[0], own.energy_j, rel_tol=1e-9):
        return f"uses {planned.energy_j[0]} J instead of {own.energy_j}"
    held_s = sum(one.end_s - one.start_s for one in own.steps if isinstance(one, Recharge))
    sessions = planned.sessions(0)
    booked_s = float((sessions[:, 3] - sessions[:, 2]).sum()) / 1000
    if not held_s - 1e-6 <= booked_s <= held_s + 0.002 * (1 + len(sessions)):
        return f"holds pads for {booked_s} s instead of {held_s}"
    return None


def test_trips_in_one_call_have_the_results_that_they_have_alone() -> None:
    problem = make_busy_problem(3)
    ledger = ledger_of(problem, begins_s=0.0)

    alone = compose_many(trips_of(problem, begins_s=0.0), ledger)
    many = compose_many(trips_of(problem, begins_s=0.0, count=300), ledger)

    assert many.end_s.tolist() == alone.end_s.tolist() * 300
    assert many.plan(299) == alone.plan(0)


@pytest.mark.parametrize(
    "make", [make_busy_problem, make_windowed_problem, make_problem_with_hours]
)
def test_a_search_frees_all_arrays_that_it_makes(make: Callable[..., Problem]) -> None:
    problem = make(3, label_limit=None, time_limit_s=None, strategy="exact")
    ledger = ledger_of(problem, begins_s=0.0)

    def plan(count: int) -> int:
        """How many arrays are left after so many trips and one plan of the problem."""
        compose_many(trips_of(problem, begins_s=0.0, count=count), ledger)
        compose(problem)
        gc.collect()
        allocated = rtsys.get_allocation_stats()
        return int(allocated.mi_alloc - allocated.mi_free)

    _nrt_python.memsys_enable_stats()
    before = plan(1)

    assert plan(100) == before


@pytest.fixture
def line(make_problem: Any) -> Problem:
    """A drone that recharges at b, which has one pad, on its way from a to c."""
    problem: Problem = make_problem("a-b:6 b-c:6", "c", soc=0.7, pads={"a": 0, "b": 1, "c": 1})
    return problem


def row_b(line: Problem) -> int:
    return line.network.row_of[StationId("b")]


def test_sessions_of_a_plan_are_reserved_and_released(line: Problem) -> None:
    ledger, trips = ledger_of(line, begins_s=0.0), trips_of(line, begins_s=0.0)
    first = compose_many(trips, ledger)
    held = first.sessions(0)

    ledger.reserve(held)
    second = compose_many(trips, ledger)

    assert held.tolist() == [[row_b(line), 0, 600_000, 1_100_000]]
    assert (first.end_s[0], second.end_s[0]) == (1_700.0, 2_200.0)
    assert first.plan(0).delivery_time_s == 1_700.0
    with pytest.raises(PadIsTaken, match="overlaps a reservation"):
        ledger.reserve(held)
    ledger.release(held)
    assert compose_many(trips, ledger).end_s[0] == 1_700.0
    with pytest.raises(PadIsTaken, match="is not reserved"):
        ledger.release(held)


def test_sessions_are_reserved_all_or_none(line: Problem) -> None:
    ledger, row = ledger_of(line, begins_s=0.0), row_b(line)
    ledger.reserve(np.array([[row, 0, 5_000, 9_000]]))

    with pytest.raises(PadIsTaken):
        ledger.reserve(np.array([[row, 0, 0, 5_000], [row, 0, 8_999, 9_500]]))

    assert ledger.book().start_ms.tolist() == [5_000]


def test_a_plan_whose_pad_another_trip_has_reserved_is_refused(line: Problem) -> None:
    ledger = ledger_of(line, begins_s=0.0)
    planned = compose_many(trips_of(line, begins_s=0.0), ledger)

    ledger.reserve(np.array([[row_b(line), 0, 700_000, 800_000]]))

    with pytest.raises(PlanRejected):
        planned.plan(0)


@settings(max_examples=15)
@given(st.data())
def test_a_ledger_has_the_windows_of_its_reservations(data: st.DataObject) -> None:
    """After sessions are reserved and released in any order, the ledger equals a new ledger."""
    problem = make_busy_problem(data.draw(st.integers(0, 40)))
    ledger, trips = ledger_of(problem, begins_s=0.0), trips_of(problem, begins_s=0.0)
    stations = len(problem.network.row_of)
    held: list[Longs] = []
    for _ in range(data.draw(st.integers(1, 100))):
        releases = data.draw(st.booleans())
        if held and releases:
            ledger.release(held.pop(data.draw(st.integers(0, len(held) - 1))))
            continue
        from_ms = data.draw(st.integers(0, 3_000_000))
        until_ms = from_ms + data.draw(st.integers(1, 100_000))
        row, pad = data.draw(st.integers(0, stations - 1)), data.draw(st.integers(0, 1))
        session = np.array([[row, pad, from_ms, until_ms]], np.int64)
        with contextlib.suppress(PadIsTaken):
            ledger.reserve(session)
            held.append(session)
        compose_many(trips, ledger)

    anew = PadLedger(ledger.terms, ledger.book())

    assert compose_many(trips, ledger).end_s[0] == compose_many(trips, anew).end_s[0]


def test_a_ledger_has_room_for_the_trees_of_a_thousand_destinations(line: Problem) -> None:
    ledger = ledger_of(line, begins_s=0.0)

    while (trees := ledger.memory.radius.size) < 1_000:
        ledger.enlarge_trees()
        assert ledger.memory.radius.size > trees


def test_trips_that_break_a_limit_are_refused_by_name(line: Problem) -> None:
    ledger, trips = ledger_of(line, begins_s=0.0), trips_of(line, begins_s=0.0, count=2)

    for column, value, message in [
        ("soc", 1.5, "soc.0"),
        ("start_row", 3, "start_row.0"),
        ("mass_kg", -1.0, "mass_kg.0"),
        ("start_s", -1.0, "start_s.0"),
        ("model", 1, "model.0"),
    ]:
        wrong = replace(trips, **{column: np.full_like(getattr(trips, column), value)})
        with pytest.raises(InvalidProblem, match=message):
            compose_many(wrong, ledger)


def test_the_stop_ends_a_call_and_labels_end_a_trip(line: Problem) -> None:
    ledger, trips = ledger_of(line, begins_s=0.0), trips_of(line, begins_s=0.0, count=20_000)

    with pytest.raises(OutOfTime):
        compose_many(trips, ledger, stop=lambda _: True)

    planned = compose_many(trips_of(line, begins_s=0.0), ledger, labels_per_trip=1)
    assert planned.outcome.tolist() == [TripOutcome.UNKNOWN]
    assert planned.plan(0).status == "unknown"
