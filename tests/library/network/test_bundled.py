import networkx
import pytest

from skyway.geo import distance_m
from skyway.ids import StationId
from skyway.network.bundled import AIRPORT_DISC_RADIUS_M, texas_corridor
from skyway.network.geojson import read_network, write_network
from skyway.network.network import Network
from skyway.network.nx import to_networkx
from skyway.planner.obstacles import meets_zone

SAN_MARCOS = StationId("san-marcos")
TOWNS = {"san-marcos", "mcqueeney", "bulverde", "san-antonio"}


@pytest.fixture(scope="module")
def corridor() -> Network:
    return texas_corridor()


def test_the_corridor_holds_the_papers_places_and_airports(corridor: Network) -> None:
    assert len(corridor.stations) == 56
    assert len(corridor.zones) == 59
    assert {station.pads for station in corridor.stations.values()} == {4}


@pytest.mark.parametrize(
    ("town", "distance_km"), [("mcqueeney", 33.6), ("bulverde", 51.7), ("san-antonio", 73.9)]
)
def test_the_towns_have_their_great_circle_distances_from_san_marcos(
    corridor: Network, town: str, distance_km: float
) -> None:
    start, end = corridor.stations[SAN_MARCOS], corridor.stations[StationId(town)]

    assert distance_m(start.position, end.position) / 1000 == pytest.approx(distance_km, abs=0.05)


@pytest.mark.parametrize("max_segment_m", [18_000.0, 20_000.0, 25_000.0])
def test_the_four_towns_are_connected_from_18_km_up(max_segment_m: float) -> None:
    graph = to_networkx(texas_corridor(max_segment_m=max_segment_m))

    assert networkx.descendants(graph, "san-marcos") | {"san-marcos"} >= TOWNS


def test_only_six_stations_are_not_connected_to_the_towns(corridor: Network) -> None:
    reached = networkx.descendants(to_networkx(corridor), "san-marcos")

    assert set(corridor.stations) - reached - {"san-marcos"} == {
        *("blanco", "canyon-lake", "elmendorf", "luling", "nixon", "stockdale")
    }


@pytest.mark.long
def test_no_segment_crosses_a_disc_and_no_station_stands_in_one(corridor: Network) -> None:
    positions = {name: station.position for name, station in corridor.stations.items()}

    for zone in corridor.zones:
        assert not any(meets_zone(zone, position, position) for position in positions.values())
        assert not any(
            meets_zone(zone, positions[segment.from_id], positions[segment.to_id])
            for segment in corridor.segments
        )


def test_discs_have_the_stated_radius_unless_a_station_is_near(corridor: Network) -> None:
    radii = {zone.zone_id: zone.properties["radius_m"] for zone in corridor.zones}

    assert max(radii.values()) == AIRPORT_DISC_RADIUS_M
    assert min(radii, key=lambda zone_id: radii[zone_id]) == "airport-k1t8"
    assert sum(radius < AIRPORT_DISC_RADIUS_M for radius in radii.values()) < 20


def test_no_segment_is_longer_than_the_line_of_sight() -> None:
    network = texas_corridor(max_segment_m=12_000.0)

    assert network.segments
    assert max(segment.length_m for segment in network.segments) <= 12_000.0


def test_the_corridor_written_as_geojson_reads_as_the_same_network(corridor: Network) -> None:
    assert read_network(write_network(corridor)) == corridor
