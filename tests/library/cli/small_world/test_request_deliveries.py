"""The customers of the small world: patient, bounded, and not confused by a restart."""

from typing import Any

import pytest

from skyway.cli.gateway import GatewayApi
from skyway.cli.small_world.drawn_request import RequestDraw
from skyway.cli.small_world.request_deliveries import MOST_OPEN, Customers
from skyway.errors import SkywayError


class FakeGateway(GatewayApi):
    """Keeps deliveries in memory; each call with its key is noted."""

    def __init__(self) -> None:
        super().__init__("http://gateway")
        self.states: dict[str, str] = {}
        self.owners: list[str] = []
        self.trouble: SkywayError | None = None

    async def call(self, method: str, path: str, *, key: str, body: object = None) -> Any:
        if self.trouble is not None:
            raise self.trouble
        if path == "/v1/clock":
            return {"now": "2026-03-01T12:00:00Z"}
        if method == "POST":
            delivery_id = f"dlv_{len(self.states)}"
            self.states[delivery_id] = "REQUESTED"
            self.owners.append(key)
            return {"delivery_id": delivery_id}
        if path.startswith("/v1/deliveries?"):
            return {"items": [{"delivery_id": each} for each in self.states]}
        return {"state": self.states[path.removeprefix("/v1/deliveries/")]}


class OneRequest(RequestDraw):
    """Draws always the same."""

    def __init__(self) -> None:
        pass

    def draw(self, now: object) -> dict[str, Any]:
        return {}


@pytest.fixture
def gateway() -> FakeGateway:
    return FakeGateway()


def customers(gateway: FakeGateway, said: list[str] | None = None) -> Customers:
    say = ([] if said is None else said).append
    return Customers(gateway, ("sk_a", "sk_b"), OneRequest(), say=say)


async def test_customers_take_turns(gateway: FakeGateway) -> None:
    both = customers(gateway)
    for _ in range(4):
        await both.step()

    assert gateway.owners == ["sk_a", "sk_b", "sk_a", "sk_b"]


async def test_never_more_deliveries_than_the_bound_are_open(gateway: FakeGateway) -> None:
    all_of_them = customers(gateway)
    for _ in range(3 * MOST_OPEN):
        await all_of_them.step()
    assert len(gateway.states) == MOST_OPEN

    gateway.states |= {"dlv_0": "COMPLETED", "dlv_3": "REJECTED"}
    for _ in range(5):
        await all_of_them.step()

    assert len(gateway.states) == MOST_OPEN + 2


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
