"""A drone's messages to the cloud: topics, envelopes, repeats until confirmed, presence."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator
from datetime import datetime
from typing import Any, Protocol, TypedDict

from skyway.contracts.drone_report import Connection
from skyway.contracts.topics import CONNECTION, Address, M, Topic
from skyway.ids import DroneId, ProviderId
from skyway.runtime.clock import FleetClock, sleep_wall
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.minting import Mint
from skyway.runtime.mqtt.client import Received

#: Wall seconds before a message without confirmation is sent again.
_RETRY_S = 0.2


class Link(Protocol):
    """What the agent needs of `skyway.runtime.mqtt.client.MqttClient`."""

    @property
    def is_connected(self) -> bool:
        """Whether the broker has accepted us."""
        ...

    async def wait_connected(self) -> None:
        """Return once the broker has accepted us."""
        ...

    async def wait_lost(self) -> None:
        """Return once the broker cannot be reached."""
        ...

    async def publish(self, address: Address[M], message: M, *, timeout_s: float = 5.0) -> None:
        """Publish; return after the PUBACK for `mqtt_qos` 1, else raise `MqttUnavailable`."""
        ...

    def batches(
        self, *subscriptions: Topic[Any] | Address[Any]
    ) -> AsyncIterator[list[Received[Any]]]:
        """The messages that arrive on these topics. Any: each topic has its own message type."""
        ...


class Envelope(TypedDict):
    """The fields that every message of a drone begins with."""

    message_id: str
    sent_at: datetime
    session: int
    seq: int


class Uplink:
    """Sends one drone's messages of one session; `seq` counts per topic."""

    def __init__(
        self,
        link: Link,
        clock: FleetClock,
        *,
        provider_id: ProviderId,
        drone_id: DroneId,
        session: int,
        mint: Mint,
    ) -> None:
        self._link = link
        self._clock = clock
        self._ids = (provider_id, drone_id)
        self._session = session
        self._mint = mint
        self._sent: Counter[str] = Counter()

    def envelope(self, topic: Topic[M]) -> Envelope:
        """The envelope of the next message on this topic."""
        self._sent[topic.template] += 1
        return self.envelope_with(self._sent[topic.template])

    def envelope_with(self, seq: int) -> Envelope:
        """An envelope whose `seq` is counted elsewhere."""
        return Envelope(
            message_id=self._mint("msg"),
            sent_at=self._clock.now(),
            session=self._session,
            seq=seq,
        )

    async def send(self, topic: Topic[M], message: M) -> None:
        """Send once; raises `MqttUnavailable` when the broker does not confirm it."""
        await self._link.publish(topic(*self._ids), message)

    async def send_until_confirmed(self, topic: Topic[M], *messages: M) -> None:
        """Send until the broker confirms the last message, also over new connections.

        The messages leave together and in order. Only the last is repeated: it says all that the
        earlier ones say.
        """
        *earlier, last = messages
        if earlier:
            confirming = (self.send(topic, message) for message in messages)
            *_, error = await asyncio.gather(*confirming, return_exceptions=True)
            if error is None:
                return
            if not isinstance(error, MqttUnavailable):
                raise error
            await self.wait_to_retry()
        while True:
            try:
                await self.send(topic, last)
            except MqttUnavailable:
                await self.wait_to_retry()
            else:
                return

    async def wait_to_retry(self) -> None:
        """Return when a message may be sent again: after a pause, on a connection."""
        await sleep_wall(self._clock, _RETRY_S)
        await self._link.wait_connected()


class Presence:
    """Makes the messages ONLINE and OFFLINE of a session's connections, and LOST as last will."""

    def __init__(
        self,
        clock: FleetClock,
        *,
        provider_id: ProviderId,
        drone_id: DroneId,
        session: int,
        mint: Mint,
    ) -> None:
        self.address: Address[Connection] = CONNECTION(provider_id, drone_id)
        self._clock = clock
        self._session = session
        self._mint = mint
        self._connection_number = 0

    def last_will(self) -> tuple[Address[Connection], Connection]:
        """The last will of the next connection; to be called once before each connect."""
        self._connection_number += 1
        return self.address, self._connection("LOST")

    def online(self) -> Connection:
        """The message that the latest connection is up."""
        return self._connection("ONLINE")

    def offline(self) -> Connection:
        """The message that the agent leaves on purpose; newer than the connection's others."""
        self._connection_number += 1
        return self._connection("OFFLINE")

    def _connection(self, status: str) -> Connection:
        return Connection.model_validate(
            {
                "message_id": self._mint("msg"),
                "sent_at": self._clock.now(),
                "session": self._session,
                "connection_number": self._connection_number,
                "status": status,
            }
        )
