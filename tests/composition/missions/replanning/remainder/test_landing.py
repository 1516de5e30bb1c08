"""The nearest landing of a drone that cannot land where it flies to."""

from typing import Any

import pytest
from skyway_composition.missions.replanning.remainder.anchor import Anchor
from skyway_composition.missions.replanning.remainder.landing import Landing, LandingSearch
from skyway_composition.planning.world import ClosedAhead

from skyway.drone.models import DRONE_MODELS
from skyway.ids import DroneModelId, StationId
from skyway.network.geojson import read_network
from skyway.planner.problem_parts import SegmentClosure, StationClosure

MODEL = DRONE_MODELS[DroneModelId("paper-scenario")]


def nearest(make: Any, soc: float, *closures: Any, is_in_the_air: bool = True) -> Landing | None:
    """The landing from c, in a row of stations 20 km apart; a flight takes 0.61 charge."""
    network = read_network(make.network())
    closed = ClosedAhead(network)
    closed.add(closures, start_ms=0)
    anchor = Anchor(
        station_id=StationId("c"),
        at_ms=0,
        soc=soc,
        last_valid_step=2,
        carried=frozenset(),
        has_loaded=True,
        is_in_the_air=is_in_the_air,
    )
    return LandingSearch(network, closed, MODEL, load_kg=0.0).nearest(anchor)


def closed_station(station_id: str) -> StationClosure:
    return StationClosure(station_id=StationId(station_id), start_s=0.0, end_s=None)


def test_a_drone_that_can_stand_at_its_anchor_stays_there(make: Any) -> None:
    landing = nearest(make, 1.0, is_in_the_air=False)

    assert landing is not None
    assert (landing.station_id, landing.flights) == ("c", ())


def test_the_drone_lands_at_the_nearest_open_station(make: Any) -> None:
    landing = nearest(make, 1.0, closed_station("c"), closed_station("b"))

    assert landing is not None
    assert landing.station_id == "d"
    assert landing.soc == pytest.approx(0.394, abs=0.001)


def test_a_closed_segment_is_not_flown(make: Any) -> None:
    way = SegmentClosure(from_id=StationId("c"), to_id=StationId("d"), start_s=0.0, end_s=None)

    landing = nearest(make, 1.0, closed_station("c"), closed_station("b"), way)

    assert landing is None


def test_a_station_out_of_reach_is_no_landing(make: Any) -> None:
    assert nearest(make, 0.5, closed_station("c")) is None


def test_a_station_that_opens_before_the_arrival_is_a_landing(make: Any) -> None:
    for_a_while = StationClosure(station_id=StationId("b"), start_s=0.0, end_s=600.0)

    landing = nearest(make, 1.0, for_a_while, closed_station("c"), closed_station("d"))

    assert landing is not None
    assert landing.station_id == "b"
