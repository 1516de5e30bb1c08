import math

import pytest

from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.network import Network, Station
from skyway.planner.subnetwork import widening_sectors

SOURCE = StationId("source")


@pytest.fixture(scope="module")
def compass():
    """A source, and stations 1 and 2 degrees away in the eight directions of the compass."""
    made = [Station(SOURCE, Position(0.0, 0.0))]
    for number, name in enumerate(["n", "ne", "e", "se", "s", "sw", "w", "nw"]):
        east, north = math.sin(number * math.pi / 4), math.cos(number * math.pi / 4)
        made += [
            Station(StationId(f"{name}{away}"), Position(away * east, away * north))
            for away in (1, 2)
        ]
    return Network({station.station_id: station for station in made}, ())


def stations(*names: str) -> list[StationId]:
    return [StationId(name) for name in names]


def test_the_first_sector_is_the_smallest_angle_with_the_farthest_target(compass):
    narrowest = next(widening_sectors(compass, SOURCE, targets=stations("n1", "e2")))

    assert narrowest == {"source", "n1", "n2", "ne1", "ne2", "e1", "e2"}


def test_the_sector_may_span_north(compass):
    narrowest = set(next(widening_sectors(compass, SOURCE, targets=stations("nw2", "ne1"))))

    assert {"nw2", "n1", "ne1"} <= narrowest
    assert not narrowest & {"e1", "s1", "w1"}


def test_one_target_makes_a_line_of_sight(compass):
    narrowest = next(widening_sectors(compass, SOURCE, targets=stations("s2")))

    assert narrowest == {"source", "s1", "s2"}


def test_sectors_grow_up_to_the_whole_network(compass):
    sizes = [len(s) for s in widening_sectors(compass, SOURCE, targets=stations("sw2"))]

    assert sizes == sorted(set(sizes))
    assert sizes[-1] == len(compass.stations)


def test_without_targets_there_is_only_the_whole_network(compass):
    assert [*widening_sectors(compass, SOURCE, targets=[])] == [compass.stations]
