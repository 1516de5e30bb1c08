"""The synthetic city and its stream of requests, the same for the same seed."""

import json
from collections import Counter

import pytest
from skyway_lab.benchmarks.load.city import City

from skyway.delivery.request import DeliveryRequest
from skyway.network.geojson import read_network


@pytest.fixture(scope="module")
def city() -> City:
    return City.of(stations=100, seed=1)


def test_its_document_is_a_network(city: City) -> None:
    assert len(read_network(city.documents()["city"]).stations) == 100


def test_its_drones_are_spread_over_stations_and_providers(city: City) -> None:
    fleets = [city.fleet(number, providers=5, drones=200) for number in range(5)]

    homes = Counter(drone["home_station_id"] for fleet in fleets for drone in fleet)
    assert [len(fleet) for fleet in fleets] == [40] * 5
    assert set(homes.values()) == {2}
    assert len(homes) == 100


def test_requests_come_at_their_rate_and_are_the_same_again(city: City) -> None:
    first = list(city.requests(rate_per_s=50, seconds=20, seed=3))
    again = list(city.requests(rate_per_s=50, seconds=20, seed=3))

    assert first == again
    assert len(first) == pytest.approx(1_000, rel=0.1)
    assert all(0 <= due.at_s < 20 for due in first)


def test_requests_are_valid_and_stay_near(city: City) -> None:
    for due in city.requests(rate_per_s=50, seconds=2, seed=3):
        request = DeliveryRequest.model_validate(json.loads(due.body))
        near = city.near[request.pickup.station_id]
        assert {package.destination.station_id for package in request.packages} <= set(near)


def test_only_the_middle_of_a_larger_city_has_drones_and_pickups() -> None:
    city = City.of(stations=400, seed=1, served=50)

    homes = {each["home_station_id"] for each in city.fleet(0, providers=1, drones=100)}
    sent = [json.loads(due.body) for due in city.requests(rate_per_s=50, seconds=20, seed=3)]
    assert len(city.network.stations) == 400
    assert homes == {*city.served}
    assert len(homes) == 50
    assert {each["pickup"]["station_id"] for each in sent} <= homes
