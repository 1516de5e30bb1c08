"""The requests of the small world: valid, near enough, and different."""

from datetime import UTC, datetime
from itertools import pairwise
from random import Random
from typing import Any

import pytest

from skyway.cli.gateway import GatewayApi
from skyway.cli.small_world.customers import LEAST_IDLE, MOST_OPEN, Customers
from skyway.cli.small_world.requests import RequestDraw
from skyway.cli.small_world.shops import OWN_SHOP, SHOPS, Shop
from skyway.delivery.request import DeliveryRequest
from skyway.errors import SkywayError
from skyway.geo import distance_m
from skyway.network.bundled import texas_corridor
from skyway.network.network import Network

NOW = datetime(2026, 3, 1, 12, tzinfo=UTC)


@pytest.fixture(scope="module")
def network() -> Network:
    return texas_corridor()


def drawn(network: Network, *, seed: int, number: int = 200) -> list[DeliveryRequest]:
    draw = RequestDraw(network, Random(seed))
    shops = (OWN_SHOP, *SHOPS.values())
    return [
        DeliveryRequest.model_validate(draw.draw(NOW, shops[turn % len(shops)]))
        for turn in range(number)
    ]


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
    assert max(away_m) <= 16_000


def test_what_customers_ask_for_varies(network: Network) -> None:
    requests = drawn(network, seed=2)

    assert {request.qos.objective for request in requests} == {"FASTEST", "CHEAPEST", "GREENEST"}
    assert {request.qos.priority for request in requests} == {"PRIORITY", "STANDARD"}
    assert {request.qos.deadline_at is None for request in requests} == {True, False}
    assert {len(request.packages) for request in requests} == {1, 2}
    assert all(one != other for one, other in pairwise(requests))


def test_the_same_chance_draws_the_same_requests(network: Network) -> None:
    assert drawn(network, seed=3, number=9) == drawn(network, seed=3, number=9)


class FakeGateway(GatewayApi):
    """Keeps deliveries in memory; each call with its key is noted."""

    def __init__(self) -> None:
        super().__init__("http://gateway")
        self.states: dict[str, str] = {}
        self.owners: list[str] = []
        self.bodies: list[Any] = []
        self.trouble: SkywayError | None = None
        self.idle = LEAST_IDLE

    async def call(self, method: str, path: str, *, key: str, body: object = None) -> Any:
        if self.trouble is not None:
            raise self.trouble
        if path.endswith("/status"):
            assert key == "sk_operator"
            return {"models": [{"idle": 1}, {"idle": self.idle - 1}]}
        if path == "/v1/clock":
            return {"now": "2026-03-01T12:00:00Z"}
        if method == "POST":
            delivery_id = f"dlv_{len(self.states)}"
            self.states[delivery_id] = "REQUESTED"
            self.bodies.append(body)
            self.owners.append(key)
            return {"delivery_id": delivery_id}
        if path.startswith("/v1/deliveries?"):
            return {"items": [{"delivery_id": each} for each in self.states]}
        return {"state": self.states[path.removeprefix("/v1/deliveries/")]}


class OneRequest(RequestDraw):
    """Draws always the same."""

    def __init__(self) -> None:
        pass

    def draw(self, now: object, shop: Shop) -> dict[str, Any]:
        return {"shop": shop.name}


@pytest.fixture
def gateway() -> FakeGateway:
    return FakeGateway()


def customers(gateway: FakeGateway, said: list[str] | None = None) -> Customers:
    say = ([] if said is None else said).append
    return Customers(
        gateway,
        {"sk_a": OWN_SHOP, "sk_b": SHOPS["river-books"]},
        OneRequest(),
        chance=Random(1),
        operator_key="sk_operator",
        say=say,
    )


async def test_customers_take_turns(gateway: FakeGateway) -> None:
    both = customers(gateway)
    for _ in range(4):
        await both.step()

    assert gateway.owners == ["sk_a", "sk_b", "sk_a", "sk_b"]
    assert [body["shop"] for body in gateway.bodies[:2]] == ["The Corner Shop", "River Books"]
    assert all(" " in body["recipient"]["name"] for body in gateway.bodies)


async def test_never_more_deliveries_than_the_bound_are_open(gateway: FakeGateway) -> None:
    all_of_them = customers(gateway)
    for _ in range(3 * MOST_OPEN):
        await all_of_them.step()
    assert len(gateway.states) == MOST_OPEN

    gateway.states |= {"dlv_0": "COMPLETED", "dlv_3": "REJECTED"}
    for _ in range(5):
        await all_of_them.step()

    assert len(gateway.states) == MOST_OPEN + 2


async def test_nothing_is_requested_while_few_drones_are_idle(gateway: FakeGateway) -> None:
    both = customers(gateway)
    gateway.idle = LEAST_IDLE - 1
    await both.step()
    assert gateway.states == {}

    gateway.idle = LEAST_IDLE
    await both.step()

    assert len(gateway.states) == 1


async def test_deliveries_of_an_earlier_start_count(gateway: FakeGateway) -> None:
    gateway.states = {f"dlv_{number}": "IN_PROGRESS" for number in range(MOST_OPEN)}

    await customers(gateway).step()

    assert len(gateway.states) == MOST_OPEN


async def test_trouble_is_said_once_and_does_not_end_it(gateway: FakeGateway) -> None:
    said: list[str] = []
    all_of_them = customers(gateway, said)
    gateway.trouble = SkywayError("the gateway starts again")
    for _ in range(3):
        await all_of_them.step()
    gateway.trouble = None
    await all_of_them.step()

    assert said == ["no delivery is requested now: the gateway starts again"]
    assert len(gateway.states) == 1
