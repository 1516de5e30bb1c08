"""Operators see queues, lags and rates of each service in the picture, and nobody else does."""

from collections.abc import Sequence
from typing import Any

import httpx
from skyway_gateway.live.feed import LiveFeed
from skyway_gateway.live.figures import LiveFigures
from skyway_gateway.live.picture import Picture
from skyway_gateway.live.scope import Scope

from skyway.contracts.figures import Figure, Figures
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.identity import Caller
from skyway.runtime.metrics import Gauge, Gauges, GaugeSource

OPERATOR = Scope.of(Caller("operator", "op"), kinds=None, bbox=None)
PROVIDER = Scope.of(Caller("provider", "prv_1"), kinds=None, bbox=None)


class Composition:
    """A composition that has counted so many requests."""

    name = "composition"

    def __init__(self) -> None:
        self.requests, self.asked, self.is_away = 100.0, 0, False

    @property
    def figures(self) -> Sequence[Figure]:
        return (
            Figure(name="process_start_time_seconds", labels={}, value=7.0),
            Figure(name="skyway_outbox_depth", labels={"channel": "mqtt"}, value=3),
            Figure(name="skyway_missions_to_replan", labels={}, value=2),
            Figure(name="skyway_http_requests_total", labels={"code": "2"}, value=self.requests),
            Figure(name="skyway_missions", labels={"state": "ACTIVE"}, value=5),
        )

    async def read(self, picture: Picture) -> None:
        """Nothing of it is in the picture."""
        if self.is_away:
            raise ServiceUnavailable(self.name, "it is away in this test")

    def forget(self) -> None:
        """Nothing was read."""

    def client(self) -> ServiceClient:
        async def answer(_request: httpx.Request) -> httpx.Response:
            self.asked += 1
            said = Figures(figures=tuple(self.figures))
            return httpx.Response(200, json=said.model_dump(mode="json"))

        identity: Any = _NoIdentity()
        transport = httpx.MockTransport(answer)
        return ServiceClient("composition", "http://composition", identity, transport=transport)


class _NoIdentity:
    """The identity of a service without a secret."""

    def headers(self, _caller: object) -> dict[str, str]:
        return {}


class Seconds:
    """A clock that moves 5 s each time it is asked."""

    def __init__(self) -> None:
        self._now = 0.0

    def __call__(self) -> float:
        self._now += 5.0
        return self._now


def services(feed: LiveFeed, scope: Scope) -> dict[str, Any]:
    """What a scope shows of the services."""
    shown = scope.part_of(feed.picture)
    return {key.item_id: item.document for key, item in shown.items() if key.kind == "services"}


async def looked(scope: Scope, composition: Composition, *, readings: int = 1) -> LiveFeed:
    """A feed that this scope looks at, after so many readings of its figures."""
    feed = LiveFeed((composition,))
    await feed.step()
    viewing = feed.viewing(scope, lambda _cost: None)
    feed._is_complete.set()
    async with composition.client() as client, viewing:
        figures = LiveFigures(feed, lambda: {"composition": client}, Gauges(), now=Seconds())
        for _ in range(readings):
            await figures.step()
            composition.requests += 20
        await feed.step()
    return feed


async def test_operators_see_the_figures_of_each_service() -> None:
    feed = await looked(OPERATOR, Composition())

    assert services(feed, OPERATOR) == {
        "composition": {
            "is_answering": True,
            "outbox_depth": {"mqtt": 3.0},
            "missions_to_replan": 2.0,
        }
    }
    assert services(feed, PROVIDER) == {"composition": {"is_answering": True}}


async def test_two_readings_of_a_process_give_its_rates() -> None:
    feed = await looked(OPERATOR, Composition(), readings=2)

    shown = services(feed, OPERATOR)["composition"]
    # Nothing was sent and no sample was written, and the clock moves 5 s for each service.
    assert shown["requests_per_s"] == 2.0
    assert "samples_written_per_s" not in shown


async def test_nothing_is_asked_while_no_operator_looks() -> None:
    composition = Composition()

    feed = await looked(PROVIDER, composition)

    assert composition.asked == 0
    assert services(feed, PROVIDER) == {"composition": {"is_answering": True}}


async def test_a_service_that_does_not_answer_has_no_figures() -> None:
    composition = Composition()
    feed = await looked(OPERATOR, composition)
    assert "outbox_depth" in services(feed, OPERATOR)["composition"]

    composition.is_away = True
    feed.figures["composition"] = {}
    await feed.step()

    shown = services(feed, OPERATOR)["composition"]
    assert shown == {"is_answering": False, "silent_since_at": shown["silent_since_at"]}


async def test_the_gateways_own_gauges_are_shown() -> None:
    async def queue() -> list[Gauge]:
        return [Gauge("skyway_queue_depth", "works", 4, {"queue": "waiting"})]

    gauges = Gauges()
    gauges.show(GaugeSource("queues", queue))
    feed = LiveFeed(())
    feed._is_complete.set()

    async with feed.viewing(OPERATOR):
        await LiveFigures(feed, dict, gauges).step()

    assert feed.figures["gateway"]["queue_depth"] == {"waiting": 4.0}
