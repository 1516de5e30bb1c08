import networkx
import pytest

from skyway.errors import InvalidInput
from skyway.geo import Position
from skyway.ids import StationId
from skyway.network.geojson import write_network
from skyway.network.nx import to_networkx
from skyway.network.synthetic import synthetic_city


@pytest.mark.parametrize("stations", [1, 2, 3, 35, 500])
@pytest.mark.parametrize("degree", [0.0, 2.0, 6.0, 100.0])
def test_a_city_is_connected(stations: int, degree: float) -> None:
    city = synthetic_city(stations=stations, seed=7, degree=degree)

    assert len(city.stations) == stations
    assert networkx.is_strongly_connected(to_networkx(city))


def test_the_same_seed_gives_the_same_city() -> None:
    assert write_network(synthetic_city(stations=60, seed=3)) == write_network(
        synthetic_city(stations=60, seed=3)
    )


def test_another_seed_gives_another_city() -> None:
    assert synthetic_city(stations=10, seed=3) != synthetic_city(stations=10, seed=4)


def test_the_first_station_of_a_seed_stays_where_it_was() -> None:
    city = synthetic_city(stations=60, seed=3)

    # Published measurements name their seed: the cities must not change under them.
    assert city.stations[StationId("s1")].position == Position(-98.4830237, 29.369359)


def test_stations_have_the_requested_mean_degree() -> None:
    city = synthetic_city(stations=400, seed=1, degree=6.0)

    assert len(city.segments) / len(city.stations) == pytest.approx(6.0, abs=0.3)


def test_stations_have_the_requested_pads() -> None:
    city = synthetic_city(stations=5, seed=1, pads=2)

    assert {station.pads for station in city.stations.values()} == {2}


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"stations": 0}, "stations"),
        ({"stations": 5, "pads": -1}, "pads"),
        ({"stations": 5, "degree": -1.0}, "degree"),
        ({"stations": 5, "degree": float("nan")}, "degree"),
        ({"stations": 5, "spacing_m": 0.0}, "spacing_m"),
    ],
)
def test_a_number_outside_its_limits_is_refused(arguments: dict[str, int], field: str) -> None:
    with pytest.raises(InvalidInput) as refusal:
        synthetic_city(seed=1, **arguments)

    assert refusal.value.field == field
