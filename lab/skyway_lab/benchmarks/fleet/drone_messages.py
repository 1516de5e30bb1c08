"""The messages of drones at the broker, as the registry gets them: how many, and how late."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Final

from skyway_lab.benchmarks.fleet.crew import PASSWORD

from skyway.contracts.drone_report import Connection, DroneState, Telemetry
from skyway.contracts.topics import CONNECTION, STATE, TELEMETRY
from skyway.runtime.mqtt.client import MqttClient, Received

_CONNECT_WITHIN_S: Final = 20.0

#: Wall seconds between two looks at the counts.
_LOOK_EVERY_S: Final = 0.02


@dataclass(slots=True)
class DroneMessages:
    """The drones by their last message, and the number of messages since `begin`.

    Moments of messages are fleet time, which in these runs is wall time.
    """

    online: set[str] = field(default_factory=set)
    airborne: set[str] = field(default_factory=set)
    states: int = 0
    samples: int = 0
    #: Seconds from a message's writing to its arrival here.
    late_s: list[float] = field(default_factory=list)

    def begin(self) -> None:
        """Start counting again."""
        self.states = self.samples = 0
        self.late_s = []

    def note(self, drone_id: str, message: Connection | DroneState | Telemetry) -> None:
        """Note one message."""
        if isinstance(message, Connection):
            (self.online.add if message.status == "ONLINE" else self.online.discard)(drone_id)
            return
        if isinstance(message, DroneState):
            self.states += 1
            is_flying = message.activity == "FLYING"
            (self.airborne.add if is_flying else self.airborne.discard)(drone_id)
        else:
            self.samples += 1
        self.late_s.append((datetime.now(UTC) - message.sent_at).total_seconds())

    async def wait_online(self, count: int, *, within_s: float) -> None:
        """Return once so many drones are online."""
        async with asyncio.timeout(within_s):
            while len(self.online) < count:  # noqa: ASYNC110 - the counts have no event
                await asyncio.sleep(_LOOK_EVERY_S)

    async def wait_airborne(self, count: int, *, within_s: float) -> None:
        """Return once so many drones fly."""
        async with asyncio.timeout(within_s):
            while len(self.airborne) < count:  # noqa: ASYNC110 - the counts have no event
                await asyncio.sleep(_LOOK_EVERY_S)


@asynccontextmanager
async def receiving(
    url: str, *, client_id: str = "bench-receives", password: str = PASSWORD
) -> AsyncIterator[DroneMessages]:
    """Receive with the registry's account while the block lasts."""
    messages = DroneMessages()
    client = MqttClient(url, client_id=client_id, user_name="registry", password=password)
    batches = client.batches(CONNECTION, STATE, TELEMETRY)
    async with client:
        async with asyncio.timeout(_CONNECT_WITHIN_S):
            await client.wait_connected()
        listener = asyncio.create_task(_listen(messages, batches))
        try:
            yield messages
        finally:
            listener.cancel()


async def _listen(messages: DroneMessages, batches: AsyncIterator[list[Received[Any]]]) -> None:
    """Any: messages of three topics."""
    async for batch in batches:
        for received in batch:
            messages.note(received.ids[1], received.message)
