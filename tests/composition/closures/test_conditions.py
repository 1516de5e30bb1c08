"""The closures of a network, as planning reads them."""

from typing import Any

import pytest
from skyway_composition.closures.closure import Area, Closure
from skyway_composition.closures.conditions import Conditions

from skyway.geo import Position
from skyway.ids import ClosureId, NetworkId, StationId
from skyway.network.geojson import read_network
from skyway.planner.pad_book import OPEN_MS


def conditions(make: Any, *closures: Any) -> Conditions:
    return Conditions(read_network(make.network()), closures)


def closure(kind: Any, **members: Any) -> Closure:
    values = {"network_id": NetworkId("row"), "from_ms": 1_000, "made_ms": 0, **members}
    return Closure(ClosureId("clo_1"), kind, **values)


def square(west: float, east: float) -> Area:
    corners = [(west, -0.1), (east, -0.1), (east, 0.1), (west, 0.1), (west, -0.1)]
    return Area(coordinates=(tuple(Position(*corner) for corner in corners),))


def test_a_closed_station_is_closed_in_every_problem(make: Any) -> None:
    current = conditions(make, closure("STATION", station_id="b", until_ms=5_000))

    (closed,) = current.problem_closures(2_000)

    assert (closed.closes, closed.start_s, closed.end_s) == ("b", -1.0, 3.0)
    assert current.problem_closures(5_000) == ()


def test_a_zone_closes_its_stations_and_the_segments_that_cross_it(make: Any) -> None:
    current = conditions(make, closure("ZONE", area=square(0.15, 0.2)))

    closes = {each.closes for each in current.problem_closures(0)}

    assert closes == {"b", ("a", "b"), ("b", "a"), ("b", "c"), ("c", "b")}


def test_a_zone_between_stations_closes_only_segments(make: Any) -> None:
    current = conditions(make, closure("ZONE", area=square(0.05, 0.1)))

    assert {each.closes for each in current.problem_closures(0)} == {("a", "b"), ("b", "a")}


@pytest.mark.parametrize(
    "gone",
    [
        closure("STATION", station_id="z"),
        closure("SEGMENT", station_id="a", to_station_id="c"),
        closure("SEGMENT", station_id="z", to_station_id="a"),
        closure("ZONE", area=square(10, 11)),
    ],
)
def test_a_closure_of_a_removed_station_or_segment_closes_nothing(make: Any, gone: Closure) -> None:
    assert conditions(make, gone).problem_closures(0) == ()


def test_an_outage_is_listed_until_it_ends(make: Any) -> None:
    current = conditions(
        make,
        closure("PAD", station_id="b", pad=1),
        closure("PAD", station_id="c", pad=0, until_ms=3_000),
    )

    assert current.pad_outages(2_000) == [("b", 1, 1_000, OPEN_MS), ("c", 0, 1_000, 3_000)]
    assert current.pad_outages(3_000) == [("b", 1, 1_000, OPEN_MS)]


@pytest.mark.parametrize(
    ("members", "is_stopped"),
    [
        ({}, True),
        ({"provider_id": "prv_1"}, True),
        ({"provider_id": "prv_2"}, False),
        ({"drone_model_id": "paper-scenario"}, True),
        ({"drone_model_id": "other"}, False),
        ({"area": square(-0.1, 0.1)}, True),
        ({"area": square(0.1, 0.2)}, False),
        ({"until_ms": 2_000}, False),
        ({"from_ms": 2_001}, False),
        ({"until_ms": 2_001, "from_ms": 2_000}, True),
    ],
)
def test_a_ground_stop_concerns_only_its_drones_area_and_time(
    make: Any, members: Any, is_stopped: bool
) -> None:
    stop = closure("GROUND_STOP", reason="storm", **members)

    reason = conditions(make, stop).ground_stop(make.candidate(), at_ms=2_000)

    assert (reason is not None) == is_stopped
    assert reason is None or "storm" in reason


def test_a_ground_stop_at_the_pickup_stops_a_drone_that_comes_from_elsewhere(make: Any) -> None:
    current = conditions(make, closure("GROUND_STOP", area=square(0.1, 0.2)))

    assert current.ground_stop(make.candidate(), at_ms=2_000) is None
    assert (
        current.ground_stop(make.candidate(), at_ms=2_000, station_ids=[StationId("b")]) is not None
    )
