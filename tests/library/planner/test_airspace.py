import random
from itertools import pairwise

from skyway.geo import Position
from skyway.ids import ZoneId
from skyway.network.network import Network, Zone
from skyway.network.synthetic import CITY_CENTRE, synthetic_city
from skyway.network.zones import contains, crosses
from skyway.planner.airspace import Airspace


def make_zone(number: int, *, chance: random.Random) -> Zone:
    east_deg, north_deg = CITY_CENTRE
    corners = [
        Position(east_deg + chance.uniform(-0.4, 0.4), north_deg + chance.uniform(-0.4, 0.4))
        for _ in range(chance.randint(3, 5))
    ]
    return Zone(ZoneId(f"z{number}"), ((*corners, corners[0]),))


def test_a_zone_reaches_the_same_as_testing_every_segment() -> None:
    city = synthetic_city(stations=300, seed=1)
    chance = random.Random(1)
    zones = [make_zone(number, chance=chance) for number in range(20)]
    network = Network(city.stations, city.segments, zones)

    airspace = Airspace.of(network)

    assert [reach.zone for reach in airspace.reaches] == zones
    position = {station_id: station.position for station_id, station in city.stations.items()}
    for reach in airspace.reaches:
        assert reach.stations == tuple(i for i in position if contains(reach.zone, position[i]))
        assert reach.segments == tuple(
            (segment.from_id, segment.to_id)
            for segment in city.segments
            if crosses(reach.zone, position[segment.from_id], position[segment.to_id])
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
