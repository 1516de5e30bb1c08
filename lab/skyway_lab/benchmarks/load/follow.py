"""When each delivery was requested, planned, dispatched and ended, as its customer learned it."""

import asyncio
import time
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field

from skyway_lab.benchmarks.load.world import World

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
    """When customers first received each kind of event over MQTT, monotonic seconds."""

    first_at: dict[DeliveryEventType, dict[DeliveryId, float]] = field(default_factory=dict)
    ended: set[DeliveryId] = field(default_factory=set)
    replanned: int = 0
    rejections: Counter[str] = field(default_factory=Counter)

    def note(self, event: DeliveryEvent, at_s: float) -> None:
        """Note one event; a copy of an earlier event changes only the count of replannings."""
        self.first_at.setdefault(event.type, {}).setdefault(event.delivery_id, at_s)
        if event.type == DeliveryEventType.REPLANNED:
            self.replanned += 1
        if event.type in LAST_EVENTS and event.delivery_id not in self.ended:
            self.ended.add(event.delivery_id)
            if event.type == DeliveryEventType.REJECTED:
                codes = {reason["code"] for reason in event.data.get("reasons", ())}
                self.rejections[", ".join(sorted(codes)) or "no reason"] += 1

    def of(self, kind: DeliveryEventType) -> dict[DeliveryId, float]:
        """When an event of this kind was first received, by delivery."""
        return self.first_at.get(kind, {})

    def count(self, kind: DeliveryEventType) -> int:
        """How many deliveries had an event of this kind."""
        return len(self.of(kind))

    def are_settled(
        self, deliveries: int, kind: DeliveryEventType = DeliveryEventType.DISPATCHED
    ) -> bool:
        """Whether so many deliveries had an event of this kind, or have ended without it."""
        return len(self.of(kind).keys() | self.ended) >= deliveries


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
            followed.note(received.message, at_s)
