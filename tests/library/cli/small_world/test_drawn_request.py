"""The requests of the small world: valid, near enough, and different."""

from datetime import UTC, datetime
from itertools import pairwise
from random import Random

import pytest

from skyway.cli.small_world.drawn_request import RequestDraw
from skyway.delivery.request import DeliveryRequest
from skyway.geo import distance_m
from skyway.network.bundled import texas_corridor
from skyway.network.network import Network

NOW = datetime(2026, 3, 1, 12, tzinfo=UTC)


@pytest.fixture(scope="module")
def network() -> Network:
    return texas_corridor()


def drawn(network: Network, *, seed: int, number: int = 200) -> list[DeliveryRequest]:
    draw = RequestDraw(network, Random(seed))
    return [DeliveryRequest.model_validate(draw.draw(NOW)) for _ in range(number)]


def test_packages_go_to_stations_that_are_neither_here_nor_far(network: Network) -> None:
    stations = network.stations

    away_m = [
        distance_m(
            stations[request.pickup.station_id].position,
            stations[package.destination.station_id].position,
        )
        for request in drawn(network, seed=1)
        for package in request.packages
    ]

    assert min(away_m) >= 6_000
    assert max(away_m) <= 20_000


def test_what_customers_ask_for_varies(network: Network) -> None:
    requests = drawn(network, seed=2)

    assert {request.qos.objective for request in requests} == {"fastest", "cheapest", "greenest"}
    assert {request.qos.priority for request in requests} == {"PRIORITY", "STANDARD"}
    assert {request.qos.deadline_at is None for request in requests} == {True, False}
    assert {len(request.packages) for request in requests} == {1, 2, 3}
    assert all(one != other for one, other in pairwise(requests))


def test_the_same_chance_draws_the_same_requests(network: Network) -> None:
    assert drawn(network, seed=3, number=9) == drawn(network, seed=3, number=9)
