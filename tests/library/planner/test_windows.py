"""Windows of the pickup and of hand-overs, on networks with round numbers."""

from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skyway.delivery.plan import Deliver, PickUp, Plan, Wait
from skyway.errors import InvalidProblem
from skyway.network.network import Network
from skyway.planner import Hierarchy, compose
from skyway.planner.problem import Problem
from skyway.planner.verify import verify
from tests.library.planner.oracles.grid import bracket
from tests.library.planner.oracles.instances import make_problem as make_random_problem
from tests.library.planner.oracles.judge import disagreements


def windowed(problem: Problem, *windows: Mapping[str, float | None], **fields: Any) -> Problem:
    """The problem with these windows, one for each package."""
    packages = [
        {**package.model_dump(), **window}
        for package, window in zip(problem.packages, windows, strict=True)
    ]
    members = {name: getattr(problem, name) for name in type(problem).model_fields}
    return Problem.model_validate({**members, "packages": packages, **fields})


def acts(plan: Plan) -> list[tuple[str, str, float, float]]:
    return [
        (step.kind, step.station_id, step.start_s, step.end_s)
        for step in plan.steps
        if isinstance(step, PickUp | Deliver | Wait)
    ]


def test_the_drone_waits_at_the_destination_until_the_window_opens(make_problem: Any) -> None:
    problem = windowed(make_problem("a-b:6", "b", dropoff_s=30), {"not_before_s": 1000})

    plan = compose(problem)

    assert plan.status == "optimal"
    assert acts(plan) == [
        ("PICK_UP", "a", 0, 0),
        ("WAIT", "b", 600, 1000),
        ("DELIVER", "b", 1000, 1030),
    ]


def test_loading_waits_for_its_window(make_problem: Any) -> None:
    problem = make_problem("a-b:6", "b", loading_s=60, pickup_not_before_s=100)

    assert acts(compose(problem))[:2] == [("WAIT", "a", 0, 100), ("PICK_UP", "a", 100, 160)]


def test_a_drone_passes_a_near_destination_whose_window_opens_later(make_problem: Any) -> None:
    problem = windowed(
        make_problem("a-b:2 b-c:2", "b", "c"), {"not_before_s": 800}, {"latest_s": 500}
    )

    plan = compose(problem)

    assert [(one.package_id, one.delivered_s) for one in plan.deliveries] == [
        ("p2", 400),
        ("p1", 800),
    ]


def test_the_time_before_a_window_is_used_to_recharge(make_problem: Any) -> None:
    plain = make_problem("a-b:6 b-c:6", "b", "c")
    late = windowed(plain, {"not_before_s": 800}, {})

    assert compose(plain).delivery_time_s == pytest.approx(1400)
    # The 200 s at b until its window opens are enough to charge for the rest.
    assert compose(late).delivery_time_s == pytest.approx(1400)


def test_a_window_that_ends_at_the_moment_of_the_hand_over_is_met(make_problem: Any) -> None:
    problem = windowed(make_problem("a-b:6", "b", dropoff_s=30), {"latest_s": 630})

    assert compose(problem).delivery_time_s == 630


@pytest.mark.parametrize("strategy", ["exact", "heuristic", "exhaustive"])
def test_no_strategy_hands_over_outside_a_window(make_problem: Any, strategy: str) -> None:
    early = make_problem("a-b:6", "b", strategy=strategy)

    waits = compose(windowed(early, {"not_before_s": 1000}))
    misses = compose(windowed(early, {"latest_s": 500}))

    assert waits.delivery_time_s == 1000
    assert not misses.is_flyable


def test_a_window_that_cannot_be_met_is_named_with_its_lateness(make_problem: Any) -> None:
    problem = windowed(make_problem("a-b:6", "b", dropoff_s=30), {"latest_s": 500})

    plan = compose(problem)

    assert plan.infeasibility is not None
    assert plan.infeasibility.code == "WINDOW_MISSED"
    assert plan.infeasibility.detail == (
        "package 'p1' cannot be handed over at 'b' by latest_s 500; with every pad free it is over "
        "130 s too late"
    )


def test_loading_that_cannot_be_over_in_time_is_named(make_problem: Any) -> None:
    problem = make_problem("a-b:6 b-c:2", "c", source="b", station="a", pickup_latest_s=400)

    infeasibility = compose(problem).infeasibility

    assert infeasibility is not None
    assert infeasibility.detail.startswith("loading at 'b' cannot be over by pickup_latest_s 400")
    assert "200 s too late" in infeasibility.detail


def test_two_windows_that_only_together_cannot_be_met_name_the_later(make_problem: Any) -> None:
    problem = windowed(make_problem("a-b:4 a-c:4", "b", "c"), {"latest_s": 500}, {"latest_s": 1000})

    infeasibility = compose(problem).infeasibility

    assert infeasibility is not None
    assert infeasibility.code == "WINDOW_MISSED"
    assert "package 'p2'" in infeasibility.detail
    assert "if the windows that end before are met" in infeasibility.detail
    assert "400 s too late" in infeasibility.detail


def test_reserved_pads_alone_make_a_window_missed(make_problem: Any, taken: Any) -> None:
    network = "a-b:8 b-c:8"
    window = {"latest_s": 3000.0}
    free = windowed(make_problem(network, "c"), window)
    busy = windowed(make_problem(network, "c", pad_reservations=taken("b", 0, 5000)), window)

    infeasibility = compose(busy).infeasibility

    assert compose(free).status == "optimal"
    assert infeasibility is not None
    assert infeasibility.code == "NO_PAD_IN_TIME"


@pytest.mark.parametrize(
    ("windows", "fields", "fault"),
    [
        (
            [{"not_before_s": 100, "latest_s": 50}, {}],
            {},
            "packages.0.latest_s: 50 is before not_before_s 100",
        ),
        (
            [{"not_before_s": 100, "latest_s": 120}, {}],
            {},
            "packages.0.latest_s: 20 s after not_before_s, the hand-over takes 30 s",
        ),
        (
            [{}, {}],
            {"pickup_not_before_s": 9, "pickup_latest_s": 8},
            "pickup_latest_s: 8 is before pickup_not_before_s 9",
        ),
        (
            [{"latest_s": 100}, {"not_before_s": 90}],
            {},
            (
                "packages.0.latest_s: 100 is 20 s too early for packages.1, "
                "which goes to 'b' too and is handed over with it, not before 90"
            ),
        ),
    ],
)
def test_a_window_that_contradicts_itself_is_a_fault_of_the_problem(
    make_problem: Any, windows: list[dict[str, float]], fields: dict[str, float], fault: str
) -> None:
    problem = make_problem("a-b:6", "b", "b", dropoff_s=30)

    with pytest.raises(InvalidProblem) as raised:
        windowed(problem, *windows, **fields)

    assert str(raised.value).endswith(fault)


_LIMITS = st.none() | st.integers(-10, 300).map(lambda tens: 10.0 * tens)


@pytest.mark.long
@settings(max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 100_000),
    begins=st.lists(_LIMITS, min_size=6, max_size=6),
    lengths=st.lists(_LIMITS, min_size=6, max_size=6),
)
def test_plans_with_random_windows_agree_with_the_grid(
    seed: int, begins: list[float | None], lengths: list[float | None]
) -> None:
    problem = make_random_problem(seed)
    windows = {}
    for number, package in enumerate(problem.packages):
        begin, length = begins[number], lengths[number]
        takes_s = problem.dropoff_s
        windows[package.destination] = {
            "not_before_s": begin,
            "latest_s": None if length is None else (begin or 0.0) + takes_s + abs(length),
        }
    problem = windowed(problem, *(windows[one.destination] for one in problem.packages))

    plan = compose(problem)

    assert disagreements(problem, plan, bracket(problem, tick_s=5.0)) == []
    prepared = compose(problem, hierarchy=Hierarchy.of(problem.network))
    assert prepared.status == plan.status
    assert prepared.delivery_time_s == pytest.approx(plan.delivery_time_s, abs=1e-6)


@pytest.mark.parametrize(
    ("windows", "fields", "violation"),
    [
        ({"not_before_s": 601}, {}, "DELIVER starts at 600.0, before 601.0"),
        ({"latest_s": 629}, {}, "DELIVER ends at 630.0, after 629.0"),
        ({}, {"pickup_not_before_s": 1}, "PICK_UP starts at 0.0, before 1.0"),
        ({}, {"pickup_latest_s": -1}, "PICK_UP ends at 0.0, after -1.0"),
    ],
)
def test_verify_refuses_a_plan_outside_a_window(
    make_problem: Any, windows: dict[str, float], fields: dict[str, float], violation: str
) -> None:
    problem = make_problem("a-b:6", "b", dropoff_s=30)
    plan = compose(problem)

    found = verify(windowed(problem, windows, **fields), plan)

    assert [(each.rule, each.detail) for each in found] == [("window", violation)]


#: A network refuses opening hours that never open.
LATER = {"exceptions": {"2026-05-01": ["08:00-09:00"]}}


def with_hours(network: Network, **spans: list[str]) -> Network:
    """The network with these opening hours on 1 March 2026, a Sunday, in UTC."""
    stations = {
        station_id: replace(
            station,
            properties={"opening_hours": {"weekly": {"sun": spans[station_id]}, **LATER}}
            if station_id in spans
            else {},
        )
        for station_id, station in network.stations.items()
    }
    return Network(stations, network.segments)


NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)


def test_a_hand_over_is_over_before_its_station_closes(
    make_problem: Any, make_network: Any
) -> None:
    network = with_hours(make_network("a-b:5.8"), b=["12:00-12:10", "12:20-13:00"])

    plan = compose(make_problem(network, "b", dropoff_s=30, start_at=NOON))

    # The drone could be there at 580 s, 20 s before the station closes for ten minutes.
    assert [(one.start_s, one.end_s) for one in plan.steps if isinstance(one, Deliver)] == [
        (1200, 1230)
    ]


def test_a_drone_does_not_land_to_charge_at_a_closed_station(
    make_problem: Any, make_network: Any
) -> None:
    network = with_hours(make_network("a-b:8 b-c:8"), b=["12:30-13:00"])

    plan = compose(make_problem(network, "c", start_at=NOON))

    (landing,) = [step for step in plan.steps if step.kind == "RECHARGE"]
    assert landing.start_s == 1800


def test_a_drone_that_stands_at_a_closed_station_leaves_with_packages_on_board(
    make_problem: Any, make_network: Any
) -> None:
    network = with_hours(make_network("a-b:6"), a=["12:30-13:00"])

    loads = compose(make_problem(network, "b", start_at=NOON))
    carries = compose(make_problem(network, "b", start_at=NOON, are_on_board=True))

    assert (loads.delivery_time_s, carries.delivery_time_s) == (2400, 600)


def test_a_station_that_does_not_open_for_two_weeks_is_unreachable(
    make_problem: Any, make_network: Any
) -> None:
    network = with_hours(make_network("a-b:6"), b=[])

    infeasibility = compose(make_problem(network, "b", start_at=NOON)).infeasibility

    assert infeasibility is not None
    assert infeasibility.code == "DESTINATION_UNREACHABLE"


def test_opening_hours_need_the_moment_of_the_start(make_problem: Any, make_network: Any) -> None:
    network = with_hours(make_network("a-b:6"), b=["12:00-13:00"])

    with pytest.raises(InvalidProblem, match="station 'b' has opening hours"):
        make_problem(network, "b")


@pytest.mark.parametrize(
    ("spans", "step"),
    [({"a": ["12:01-13:00"]}, "PICK_UP"), ({"b": ["12:00-12:10"]}, "DELIVER")],
)
def test_verify_refuses_packages_that_change_hands_at_a_closed_station(
    make_problem: Any, make_network: Any, spans: dict[str, list[str]], step: str
) -> None:
    network = make_network("a-b:6")
    plan = compose(make_problem(network, "b", dropoff_s=30, start_at=NOON))
    closed = make_problem(with_hours(network, **spans), "b", dropoff_s=30, start_at=NOON)

    found = verify(closed, plan)

    assert {each.rule for each in found} == {"closed"}
    assert any(each.detail.startswith(step) for each in found)


def test_verify_refuses_a_landing_at_a_closed_station(make_problem: Any, make_network: Any) -> None:
    network = make_network("a-b:8 b-c:8")
    plan = compose(make_problem(network, "c", start_at=NOON))
    closed = make_problem(with_hours(network, b=["12:30-13:00"]), "c", start_at=NOON)

    (violation,) = verify(closed, plan)

    assert violation.detail == "station 'b' is not open from 800.0 s to 800.0 s"


def test_a_window_that_ends_before_its_station_opens_is_missed_by_the_difference(
    make_problem: Any, make_network: Any
) -> None:
    network = with_hours(make_network("a-b:6"), b=["12:30-13:00"])
    problem = windowed(make_problem(network, "b", start_at=NOON), {"latest_s": 1500})

    infeasibility = compose(problem).infeasibility

    assert infeasibility is not None
    assert (infeasibility.code, infeasibility.station_id) == ("WINDOW_MISSED", "b")
    assert infeasibility.late_s == 300
