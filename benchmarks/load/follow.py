"""When each delivery was requested, planned, dispatched and ended, as its customer was told."""

import asyncio
import time
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field

from benchmarks.load.world import World
from skyway.contracts.delivery_event import DeliveryEvent, DeliveryEventType
from skyway.contracts.topics import DELIVERY_EVENTS
from skyway.ids import DeliveryId
from skyway.runtime.mqtt.client import MqttClient, Received

#: The last event of a delivery is one of these.
LAST_EVENTS = {
    DeliveryEventType.COMPLETED,
    DeliveryEventType.PARTIALLY_COMPLETED,
    DeliveryEventType.FAILED,
    DeliveryEventType.REJECTED,
    DeliveryEventType.CANCELLED,
}


@dataclass(slots=True)
class Followed:
    """What customers heard over MQTT: the first moment of each kind of event, monotonic seconds."""

    heard: dict[DeliveryEventType, dict[DeliveryId, float]] = field(default_factory=dict)
    ended: set[DeliveryId] = field(default_factory=set)
    replanned: int = 0
    rejections: Counter[str] = field(default_factory=Counter)

    def take(self, event: DeliveryEvent, at_s: float) -> None:
        """Note one event; a copy of one that is known changes nothing but the replannings."""
        self.heard.setdefault(event.type, {}).setdefault(event.delivery_id, at_s)
        if event.type == DeliveryEventType.REPLANNED:
            self.replanned += 1
        if event.type in LAST_EVENTS and event.delivery_id not in self.ended:
            self.ended.add(event.delivery_id)
            if event.type == DeliveryEventType.REJECTED:
                codes = {reason["code"] for reason in event.data.get("reasons", ())}
                self.rejections[", ".join(sorted(codes)) or "no reason"] += 1

    def of(self, kind: DeliveryEventType) -> dict[DeliveryId, float]:
        """When this was first told, by delivery."""
        return self.heard.get(kind, {})

    def dispatched(self) -> int:
        """How many deliveries a drone has taken."""
        return len(self.of(DeliveryEventType.DISPATCHED))

    def are_settled(self, wanted: int) -> bool:
        """Whether so many deliveries are dispatched, or over without that."""
        return len(self.of(DeliveryEventType.DISPATCHED).keys() | self.ended) >= wanted


@asynccontextmanager
async def following(world: World, *, mqtt_url: str) -> AsyncIterator[Followed]:
    """Listen for every customer while the block lasts."""
    followed = Followed()
    async with AsyncExitStack() as stack:
        for customer in world.customers:
            client = MqttClient(
                mqtt_url,
                client_id=customer.mqtt_user_name,
                user_name=customer.mqtt_user_name,
                password=customer.mqtt_password,
            )
            batches = client.batches(DELIVERY_EVENTS)
            await stack.enter_async_context(client)
            async with asyncio.timeout(20.0):
                await client.wait_connected()
            listener = asyncio.create_task(_listen(followed, batches))
            stack.callback(listener.cancel)
        yield followed


async def _listen(
    followed: Followed, batches: AsyncIterator[list[Received[DeliveryEvent]]]
) -> None:
    async for batch in batches:
        at_s = time.monotonic()
        for received in batch:
            followed.take(received.message, at_s)
