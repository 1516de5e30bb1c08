"""The paper's scenario: a customer plays it through the public interfaces of a running system.

Beside it, a provider with one drone serves two deliveries: the second is booked behind the first,
while the drone is busy.
"""

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from skyway.cli.demo.flown import Flown
from skyway.cli.demo.screen import DemoScreen
from skyway.cli.demo.webhook_receiver import NotificationOrder, WebhookReceiver
from skyway.cli.demo.world import (
    CHAINED_REQUESTS,
    OTHER_REQUESTS,
    PACKAGES,
    PICKUP,
    World,
    delivery_request,
    load_for_ever,
    register,
    until_all_stand_ready,
)
from skyway.cli.gateway import GatewayApi
from skyway.cli.system.running_system import System
from skyway.cli.system.secrets import read_secret
from skyway.contracts.broker_rules import DEPLOYMENT_OPERATOR
from skyway.contracts.drone_report import DroneEvent, DroneState, Telemetry
from skyway.contracts.topics import EVENTS, STATE, TELEMETRY
from skyway.errors import SkywayError
from skyway.runtime.mqtt.client import MqttClient

#: How long the drones may take to get ready, and the delivery to end, wall seconds: about eight
#: times the usual time, because the machine may be busy. A process that keeps dying ends the demo
#: immediately.
_READY_WITHIN_S = 90.0

_ENDED_WITHIN_S = 300.0

_TERMINAL = frozenset({"COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED"})

_LAST_EVENTS = frozenset(f"delivery.{state.lower()}" for state in _TERMINAL)

#: How long a webhook is held so that one of an earlier moment can be shown first, wall seconds.
_HOLD_S = 1.0

_DECIDED = frozenset({"PLANNED", "DISPATCHED", "LOADING", "IN_PROGRESS", "COMPLETED"})

_LOST = frozenset({"PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED"})


async def play(system: System, screen: DemoScreen) -> None:
    """Register all participants, request the delivery, and show it until its last webhook.

    Raises
    ------
    SkywayError
        The delivery did not complete, or not in time.
    """
    operator_key = read_secret(system.folder, "operator_key")
    with WebhookReceiver() as receiver:
        async with GatewayApi(system.urls["gateway"]) as api, _watching(system) as watch:
            async with _in_time(_READY_WITHIN_S, "the drones are not ready", system):
                world = await register(api, operator_key, folder=system.folder.path)
                screen.cast(world.provider_names)
                system.start_fleet("fleet", world.fleet_file)
                await until_all_stand_ready(api, operator_key, world)
            async with _loading(api, operator_key):
                chain = Chain(api, world, screen)
                await chain.request()
                await _others_request(api, world, screen)
                await _register_webhook(api, world, receiver)
                started = time.monotonic()
                async with _in_time(_ENDED_WITHIN_S, "the delivery has not ended", system):
                    path = await _accept_best_offer(api, world, screen)
                    delivery = await _follow(api, world, path, receiver, watch, screen, chain)
            screen.end(delivery, watch.flown, wall_s=time.monotonic() - started)
            chain.compare(watch.flown)
    if delivery["state"] != "COMPLETED":
        raise SkywayError(
            f"delivery {delivery['delivery_id']} ended {delivery['state']}: {delivery['reasons']}; "
            f"the logs are in {system.folder.logs}"
        )


class _Observed:
    """What an operator observed on MQTT: each drone's state and charge, and the flown steps."""

    def __init__(self) -> None:
        self.states: dict[str, DroneState] = {}
        self.charges: dict[str, float] = {}
        self.flown = Flown()

    async def look(self, mqtt: MqttClient) -> None:
        """Record states, telemetry and events; this never returns."""
        async for batch in mqtt.batches(STATE, TELEMETRY, EVENTS):
            for received in batch:
                message = received.message
                if isinstance(message, DroneEvent):
                    self.flown.add(message)
                    continue
                if isinstance(message, DroneState):
                    self.states[received.ids[1]] = message
                if isinstance(message, DroneState | Telemetry):
                    self.charges[received.ids[1]] = message.soc


class Chain:
    """The deliveries of a provider that has one drone, and what was shown of them."""

    def __init__(self, api: GatewayApi, world: World, screen: DemoScreen) -> None:
        self._api, self._world, self._screen = api, world, screen
        self._deliveries: list[dict[str, Any]] = []

    @property
    def has_ended(self) -> bool:
        """Whether both packages are delivered."""
        return all(each["state"] == "COMPLETED" for each in self._deliveries)

    async def request(self) -> None:
        """Request both deliveries; each is planned before the next one is requested."""
        for pickup, packages in CHAINED_REQUESTS:
            body = delivery_request(
                pickup, packages, objective="FASTEST", pinned=self._world.courier_id
            )
            created = await self._call("POST", "/v1/deliveries", body)
            delivery = await self._read(created["delivery_id"])
            while delivery["state"] not in _DECIDED:
                await asyncio.sleep(0.1)  # another process decides: no event can be awaited
                delivery = await self._read(created["delivery_id"])
            self._deliveries.append(delivery)
            self._screen.chained(delivery, number=len(self._deliveries))

    async def look(self) -> None:
        """Show what has changed since the last look."""
        for index, before in enumerate(self._deliveries):
            if before["state"] == "COMPLETED":
                continue
            delivery = self._deliveries[index] = await self._read(before["delivery_id"])
            if delivery["state"] != before["state"]:
                self._screen.chained(delivery, number=index + 1)

    def compare(self, flown: Flown) -> None:
        """Show the plans beside what was flown."""
        for delivery in self._deliveries:
            self._screen.compare(delivery, flown)

    async def _read(self, delivery_id: str) -> dict[str, Any]:
        """The delivery.

        Raises
        ------
        SkywayError
            The delivery was not served.
        """
        delivery = await self._call("GET", f"/v1/deliveries/{delivery_id}", None)
        if delivery["state"] in _LOST:
            raise SkywayError(
                f"delivery {delivery_id} ended {delivery['state']}: {delivery['reasons']}"
            )
        return delivery

    async def _call(self, method: str, path: str, body: object) -> dict[str, Any]:
        key = self._world.courier_customer_key
        answer: dict[str, Any] = await self._api.call(method, path, key=key, body=body)
        return answer


@asynccontextmanager
async def _watching(system: System) -> AsyncIterator[_Observed]:
    """Observe all drones with the operator's MQTT account while the block runs."""
    mqtt = MqttClient(
        system.mqtt_url,
        client_id=DEPLOYMENT_OPERATOR,
        user_name=DEPLOYMENT_OPERATOR,
        password=read_secret(system.folder, "mqtt_operator"),
    )
    watch = _Observed()
    async with mqtt, asyncio.TaskGroup() as tasks:
        looking = tasks.create_task(watch.look(mqtt))
        yield watch
        looking.cancel()


@asynccontextmanager
async def _loading(api: GatewayApi, operator_key: str) -> AsyncIterator[None]:
    """Let the providers' loaders work while the block runs."""
    async with asyncio.TaskGroup() as tasks:
        loading = tasks.create_task(load_for_ever(api, operator_key))
        yield
        loading.cancel()


@asynccontextmanager
async def _in_time(limit_s: float, trouble: str, system: System) -> AsyncIterator[None]:
    try:
        async with asyncio.timeout(limit_s):
            yield
    except TimeoutError as error:
        detail = f"{trouble} within {limit_s:.0f} s; the logs are in {system.folder.logs}"
        raise SkywayError(detail) from error


async def _others_request(api: GatewayApi, world: World, screen: DemoScreen) -> None:
    """Have the other customer's deliveries planned first, so that some pads and drones are busy."""
    key = world.other_customer_key
    for pickup, packages in OTHER_REQUESTS:
        body = delivery_request(pickup, packages, objective="CHEAPEST")
        await api.call("POST", "/v1/deliveries", key=key, body=body)
    page = await api.call("GET", "/v1/deliveries", key=key)
    while any(delivery["state"] == "REQUESTED" for delivery in page["items"]):
        await asyncio.sleep(0.1)  # another process decides: no event can be awaited
        page = await api.call("GET", "/v1/deliveries", key=key)
    screen.others(page["items"])


async def _register_webhook(api: GatewayApi, world: World, receiver: WebhookReceiver) -> None:
    body = {"url": receiver.url}
    answer = await api.call("POST", "/v1/webhooks", key=world.customer_key, body=body)
    receiver.secret = answer["secret"]


async def _accept_best_offer(api: GatewayApi, world: World, screen: DemoScreen) -> str:
    """Ask for offers by two objectives and accept the fastest; the path of the delivery."""
    key = world.customer_key
    for objective in ("CHEAPEST", "FASTEST"):
        request = delivery_request(PICKUP, PACKAGES, objective=objective)
        quote: dict[str, Any] = await api.call("POST", "/v1/quotes", key=key, body=request)
        screen.offers(quote, objective=objective)
    screen.request(request)
    accepted = {"quote_id": quote["quote_id"], "offer_id": quote["offers"][0]["offer_id"]}
    created = await api.call("POST", "/v1/deliveries", key=key, body=accepted)
    return f"/v1/deliveries/{created['delivery_id']}"


async def _follow(
    api: GatewayApi,
    world: World,
    path: str,
    receiver: WebhookReceiver,
    watch: _Observed,
    screen: DemoScreen,
    chain: Chain,
) -> dict[str, Any]:
    """The delivery's JSON at its end, when its last webhook has arrived and the chain has ended."""
    planned_revision: tuple[str, int] | None = None
    order, has_ended = NotificationOrder(hold_s=_HOLD_S), False
    while True:
        delivery: dict[str, Any] = await api.call("GET", path, key=world.customer_key)
        for mission in delivery["missions"][-1:]:
            if planned_revision != (mission["mission_id"], mission["revision"]):
                planned_revision = (mission["mission_id"], mission["revision"])
                screen.plan(mission)
            drone_id = mission["drone_id"]
            if drone_id in watch.states:
                screen.progress(delivery, watch.states[drone_id], charge=watch.charges[drone_id])
        while not receiver.notifications.empty():
            notification = receiver.notifications.get_nowait()
            order.add(notification, arrived_s=time.monotonic())
            has_ended = has_ended or notification.event["type"] in _LAST_EVENTS
        for notification in order.due(time.monotonic()):
            screen.notified(notification)
        await chain.look()
        if has_ended and delivery["state"] in _TERMINAL and chain.has_ended:
            for notification in order.remaining():
                screen.notified(notification)
            return delivery
        await asyncio.sleep(0.1)  # the screen's pace
