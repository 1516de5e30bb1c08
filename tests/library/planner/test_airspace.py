import random
from collections.abc import Callable
from itertools import pairwise

import pytest

from skyway.delivery.plan import PlanStatus
from skyway.geo import Position
from skyway.ids import ZoneId
from skyway.network.network import Network, Zone
from skyway.network.synthetic import CITY_CENTRE, synthetic_city
from skyway.planner import compose
from skyway.planner.airspace import Airspace
from skyway.planner.obstacles import meets_zone
from skyway.planner.problem import Problem
from skyway.planner.stop import OutOfTime


def make_zone(number: int, *, chance: random.Random) -> Zone:
    east_deg, north_deg = CITY_CENTRE
    corners = [
        Position(east_deg + chance.uniform(-0.4, 0.4), north_deg + chance.uniform(-0.4, 0.4))
        for _ in range(chance.randint(3, 5))
    ]
    return Zone(ZoneId(f"z{number}"), ((*corners, corners[0]),))


def test_a_zone_reaches_the_same_as_testing_every_segment() -> None:
    city = synthetic_city(stations=100, seed=1)
    chance = random.Random(1)
    zones = [make_zone(number, chance=chance) for number in range(8)]
    network = Network(city.stations, city.segments, zones)

    airspace = Airspace.of(network)

    assert [reach.zone for reach in airspace.reaches] == zones
    position = {station_id: station.position for station_id, station in city.stations.items()}
    for reach in airspace.reaches:
        assert reach.stations == tuple(
            i for i in position if meets_zone(reach.zone, position[i], position[i])
        )
        assert reach.segments == tuple(
            (segment.from_id, segment.to_id)
            for segment in city.segments
            if meets_zone(reach.zone, position[segment.from_id], position[segment.to_id])
        )


def test_rows_are_the_rows_of_stations_and_segments_in_ascending_order() -> None:
    city = synthetic_city(stations=300, seed=1)
    zone = make_zone(1, chance=random.Random(2))

    (reach,) = Airspace.of(Network(city.stations, city.segments, [zone])).reaches

    assert [city.columns.station_ids[row] for row in reach.station_rows] == list(reach.stations)
    met = [city.segments[row] for row in reach.segment_rows.tolist()]
    assert [(segment.from_id, segment.to_id) for segment in met] == list(reach.segments)
    for rows in (reach.station_rows, reach.segment_rows):
        assert all(one < other for one, other in pairwise(rows.tolist()))


def test_without_zones_nothing_is_reached() -> None:
    assert Airspace.of(synthetic_city(stations=3, seed=1)).reaches == ()


def test_a_stop_ends_the_preparation_between_two_lines_of_a_zone() -> None:
    city = synthetic_city(stations=300, seed=1)
    zone = make_zone(1, chance=random.Random(2))
    asked = 0

    def third_time(_labels: int) -> bool:
        nonlocal asked
        asked += 1
        return asked == 3

    with pytest.raises(OutOfTime):
        Airspace.of(Network(city.stations, city.segments, [zone]), stop=third_time)
    assert asked == 3


def test_a_plan_whose_time_is_up_before_the_search_is_unknown(
    make_network: Callable[..., Network], make_problem: Callable[..., Problem]
) -> None:
    network = make_network("a-b:5", pads={"a": 1, "b": 1})
    zoned = Network(network.stations, network.segments, [make_zone(1, chance=random.Random(2))])
    problem = make_problem(zoned, "b", source="a")

    assert compose(problem, stop=lambda _labels: True).status is PlanStatus.UNKNOWN
