"""Exact plans where pads fit some drones only: the same as without the pads that do not fit."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from skyway.delivery.plan import Recharge
from skyway.drone.flight import flight_energy_j
from skyway.errors import InvalidProblem
from skyway.geo import Position
from skyway.ids import ConnectorId, StationId
from skyway.network.network import Network, Segment, Station
from skyway.planner import Hierarchy, TripTerms, compose
from skyway.planner.problem import Problem
from skyway.planner.situation import energy_to_pad_j
from skyway.planner.verify import verify
from tests.library.planner.oracles.grid import bracket
from tests.library.planner.oracles.instances import (
    make_busy_problem,
    make_problem_with_connectors,
    make_stormy_problem,
    make_windowed_problem,
    make_windy_problem,
    with_connectors,
)
from tests.library.planner.oracles.judge import disagreements, disagreements_with_contestants


def without_unfit_pads(made: dict[str, Any]) -> Problem:
    """The problem without connectors, on a network without the pads that do not fit the drone."""
    unfit, features = set(), []
    for feature in made["network"]["features"]:
        properties = dict(feature["properties"])
        if "own" not in properties.pop("pad_connectors", ["own"]):
            unfit.add(properties["station_id"])
            properties |= {"pads": 0, "parking": False}
        features.append({**feature, "properties": properties})
    held = [one for one in made["pad_reservations"] if one["station_id"] not in unfit]
    network = {**made["network"], "features": features}
    return Problem.model_validate({**made, "network": network, "pad_reservations": held})


@pytest.mark.parametrize(
    "make", [make_stormy_problem, make_busy_problem, make_windowed_problem, make_windy_problem]
)
def test_a_plan_is_the_plan_without_the_pads_that_do_not_fit(
    make: Callable[[int], Problem],
) -> None:
    for seed in range(40):
        made = with_connectors(seed, make(seed).model_dump(mode="json"))
        problem, expected = Problem.model_validate(made), compose(without_unfit_pads(made))

        plan = compose(problem)
        assert (plan.status, plan.steps) == (expected.status, expected.steps), seed
        assert not plan.is_flyable or verify(problem, plan) == (), seed
        ranked = compose(problem, hierarchy=Hierarchy.of(problem.network))
        assert ranked.delivery_time_s == pytest.approx(plan.delivery_time_s), seed


@pytest.mark.long
def test_no_plan_is_later_than_the_grids_or_earlier_than_possible() -> None:
    faults = {}
    for seed in range(30):
        problem = make_problem_with_connectors(seed)
        plan = compose(problem)
        faults[seed] = disagreements(problem, plan, bracket(problem, tick_s=5.0))
        faults[seed] += disagreements_with_contestants(problem, plan)

    assert {seed: words for seed, words in faults.items() if words} == {}


def with_pads(network: Network, connectors: Mapping[str, list[str]]) -> Network:
    """The network with these connectors of the pads of some stations."""
    stations = {
        name: replace(station, properties={"pad_connectors": connectors[name]})
        if name in connectors
        else station
        for name, station in network.stations.items()
    }
    return Network(stations, network.segments)


def connected(problem: Problem, connector: str | None) -> Problem:
    """The problem for a drone with this connector."""
    drone = problem.drone
    model = drone.model.model_copy(
        update={"connector": None if connector is None else ConnectorId(connector)}
    )
    return problem.model_copy(update={"drone": drone.model_copy(update={"model": model})})


@pytest.fixture
def beyond_range(
    make_network: Callable[..., Network], make_problem: Callable[..., Problem]
) -> Callable[..., Problem]:
    """From a by b or d to c, beyond the range of 10 km; the pads at b have only blades."""

    def make(connector: str | None, **fields: Any) -> Problem:
        network = with_pads(make_network("a-b:6 b-c:6 a-d:7 d-c:7"), {"b": ["blade"]})
        return connected(make_problem(network, "c", **fields), connector)

    return make


def charged_at(problem: Problem) -> list[str]:
    return [step.station_id for step in compose(problem).steps if isinstance(step, Recharge)]


@pytest.mark.parametrize(
    ("connector", "stations"), [(None, ["b"]), ("blade", ["b"]), ("pin", ["d"])]
)
def test_a_drone_flies_a_detour_to_pads_that_fit_it(
    beyond_range: Callable[..., Problem], connector: str | None, stations: list[str]
) -> None:
    assert charged_at(beyond_range(connector)) == stations


def test_a_session_on_pads_that_do_not_fit_is_refused(
    beyond_range: Callable[..., Problem],
) -> None:
    plan = compose(beyond_range("blade"))

    (violation,) = verify(beyond_range("pin"), plan)

    assert violation.rule == "connector"
    assert violation.detail == "pin does not fit pads with blade"


def test_no_plan_ends_where_no_pad_that_fits_is_in_reach(
    make_network: Callable[..., Network], make_problem: Callable[..., Problem]
) -> None:
    network = with_pads(make_network("a-b:6"), {"a": ["blade"], "b": ["blade"]})
    fitting = make_problem(network, "b")
    plan, unfit = compose(connected(fitting, "blade")), connected(fitting, "pin")

    assert plan.is_flyable
    assert not compose(unfit).is_flyable
    assert [each.rule for each in verify(unfit, plan)] == ["finish"]


def test_terms_are_for_drones_that_fit_the_same_pads(
    beyond_range: Callable[..., Problem],
) -> None:
    problems = [beyond_range(each) for each in ("blade", "pin", None)]
    network = problems[0].network
    blade, pin, any_pad = (each.drone.model for each in problems)

    assert len(TripTerms.of(network, [blade, any_pad]).models) == 2
    with pytest.raises(InvalidProblem, match="do not all fit the same pads"):
        TripTerms.of(network, [blade, pin])


def test_pads_are_searched_as_far_as_a_full_battery_reaches(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stations = {
        StationId(f"s{number}"): Station(
            StationId(f"s{number}"),
            Position(longitude_deg=0.01 * number, latitude_deg=0.0),
            properties={"pad_connectors": ["other"]},
        )
        for number in range(1_000)
    }
    ways = [Segment(one, other, 1_000.0) for one, other in pairwise(stations)]
    network = Network(stations, ways)
    made = make_busy_problem(0).drone.model
    model = made.model_copy(update={"connector": ConnectorId("own")})
    reach = model.battery_j / flight_energy_j(model, length_m=1_000.0, load_kg=0.0)
    leaving: dict[StationId, tuple[Segment, ...]] = {each.from_id: (each,) for each in ways}
    looked_at: list[StationId] = []

    def segments_from(_: Network, start: StationId) -> tuple[Segment, ...]:
        looked_at.append(start)
        return leaving.get(start, ())

    monkeypatch.setattr(Network, "segments_from", segments_from)

    found_j = energy_to_pad_j(network.fitting(model.connector), model, StationId("s0"))

    assert found_j == math.inf
    assert len(looked_at) == math.floor(reach) + 1 < 1_000
