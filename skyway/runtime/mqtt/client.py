"""A client of the broker that reconnects until it is stopped, with typed messages and batches."""

import asyncio
import contextlib
import hashlib
import itertools
import logging
import random
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any, Final, Never, Self, overload

from pydantic import BaseModel

from skyway.contracts.message import Message
from skyway.contracts.topics import Address, M, Topic
from skyway.runtime.errors import MqttUnavailable, ServiceUnavailable
from skyway.runtime.loops import MissingParts, pause_s
from skyway.runtime.metrics import Gauge
from skyway.runtime.mqtt.address import BrokerAddress
from skyway.runtime.mqtt.connection import Login, MqttConnection, RawMessage
from skyway.runtime.mqtt.inbox import Doorkeeper, Inbox, Received, Subscription
from skyway.runtime.signing.seal import NoSeal, Seal

__all__ = ["MqttClient", "Received"]

log = logging.getLogger(__name__)

#: Seconds for the TCP connection and the broker's answer together.
_CONNECT_TIMEOUT_S: Final = 10.0

#: Seconds between two attempts to connect: doubled from the first to the last, less some jitter.
_FIRST_PAUSE_S: Final = 0.1
_LONGEST_PAUSE_S: Final = 2.0

#: Hexadecimal digits of a client id that are derived from the password.
_ID_DIGITS: Final = 32

Will = Callable[[], tuple[Address[Any], Message]]


class MqttClient:
    """A connection to the broker that is opened again whenever it is lost.

    Parameters
    ----------
    url
        ``mqtt://host:port`` or ``mqtts://host:port`` (`BrokerAddress`); the addresses of a
        cluster's nodes are separated by commas. The first connection goes to any node, the next
        connection to another.
    client_id
        Its name in logs. At the broker it ends with a hash of the password: some brokers give the
        connection of a client to anyone who knows its id.
    will
        Called before every attempt to connect, because a last will is fixed at CONNECT.
    on_connected
        Runs after every connect, once the subscriptions are renewed: republish what is retained.
    keepalive_s
        Wall seconds of silence after which a ping is sent. When a client is silent for 1.5 times as
        long, the broker gives it up and sends its last will.
    tls
        What ``mqtts`` trusts and shows; by default the system's roots and no certificate.
    seal
        Signs published messages, and refuses messages without a valid signature; by default
        neither.

    Notes
    -----
    A publish that is not acknowledged raises `MqttUnavailable`, and its sender decides what to do:
    nothing is sent again by itself after a reconnect.
    """

    def __init__(
        self,
        url: str,
        *,
        client_id: str,
        user_name: str,
        password: str,
        will: Will | None = None,
        on_connected: Callable[[], Awaitable[None]] | None = None,
        keepalive_s: int = 10,
        tls: ssl.SSLContext | None = None,
        seal: Seal | None = None,
    ) -> None:
        brokers = BrokerAddress.parse_all(url)
        # Clients that lose a node together spread over the others.
        self._brokers = itertools.cycle(random.sample(brokers, len(brokers)))
        self._broker = brokers[0]
        self._tls = tls
        self._seal = seal or NoSeal()
        self._name = client_id
        self._login = Login(_unguessable(client_id, password), user_name, password, keepalive_s)
        self._will = will
        self._on_connected = on_connected
        self._link: MqttConnection | None = None
        self._inboxes: list[Inbox] = []
        self._subscribed = 0  # how many of the inboxes the broker knows of
        self._has_new_inbox = asyncio.Event()
        self._connected = asyncio.Event()
        self._lost = asyncio.Event()
        self._lost.set()
        self._running: asyncio.Task[Never] | None = None

    async def __aenter__(self) -> Self:
        self._running = asyncio.create_task(self._run(), name=f"mqtt {self._name}")
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._running is not None:
            self._running.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._running

    @property
    def is_connected(self) -> bool:
        """Whether the broker has accepted us and all subscriptions are in force."""
        return self._connected.is_set()

    async def wait_connected(self) -> None:
        """Return once the broker has accepted us and all subscriptions are in force."""
        await self._connected.wait()

    async def wait_lost(self) -> None:
        """Return once there is no connection; immediately while there is none."""
        await self._lost.wait()

    async def publish(self, address: Address[M], message: M, *, timeout_s: float = 5.0) -> None:
        """Publish a message on its topic; for `mqtt_qos` 1 return after the PUBACK.

        Raises
        ------
        MqttUnavailable
            Not connected, the connection was lost, or no PUBACK within `timeout_s` of wall time.
        """
        await self.publish_raw(
            address.name,
            _payload(message),
            mqtt_qos=address.topic.mqtt_qos,
            retained=address.topic.retained,
            timeout_s=timeout_s,
        )

    async def publish_raw(
        self,
        name: str,
        payload: bytes,
        *,
        mqtt_qos: int,
        retained: bool,
        timeout_s: float = 5.0,
    ) -> None:
        """Publish the bytes of a JSON object, as `publish` does."""
        if self._link is None:
            raise MqttUnavailable(f"{self._name} is not connected to the broker")
        try:
            async with asyncio.timeout(timeout_s):
                await self._link.publish(self._sealed(name, payload, mqtt_qos, retained))
        except TimeoutError as error:
            raise MqttUnavailable(f"no PUBACK on {name} within {timeout_s:g} s") from error

    async def gauges(self) -> list[Gauge]:
        """How much waits in the inboxes of this client, and for how long."""
        waiting = sum(inbox.waiting for inbox in self._inboxes)
        lag_s = max((inbox.lag_s for inbox in self._inboxes), default=0.0)
        return [
            Gauge("skyway_mqtt_inbox_depth", "messages that wait for their reader", waiting),
            Gauge("skyway_mqtt_inbox_age_seconds", "age of the oldest of them", lag_s),
        ]

    def drop(self) -> None:
        """Drop the connection without a goodbye, like a lost radio link: the last will is sent."""
        if self._link is not None:
            self._link.drop()

    @overload
    def batches(self, only: Topic[M] | Address[M], /) -> AsyncIterator[list[Received[M]]]: ...

    @overload
    def batches(
        self, *subscriptions: Subscription, doorkeeper: Doorkeeper | None = None
    ) -> AsyncIterator[list[Received[Any]]]: ...

    def batches(
        self, *subscriptions: Subscription, doorkeeper: Doorkeeper | None = None
    ) -> AsyncIterator[list[Received[Any]]]:
        """Everything that has arrived, in order, at most 500 messages at a time.

        Subscribes at the call, not at the first step of the iteration, and for the client's life.
        """
        inbox = Inbox(subscriptions, doorkeeper)
        self._inboxes.append(inbox)
        self._connected.clear()
        self._has_new_inbox.set()
        return inbox.batches()

    def subscribe_again(self) -> None:
        """Subscribe again to everything: the broker then sends what it has retained once more."""
        self._subscribed = 0
        self._has_new_inbox.set()

    def _arrived(self, name: str, payload: bytes, retained: bool) -> None:
        if not payload:  # this is how MQTT clears a retained message
            return
        if not self._seal.admits(name, payload):
            return
        for inbox in self._inboxes:
            inbox.offer(name, payload, retained=retained)

    async def _run(self) -> Never:
        """Connect and serve until the connection is lost, again and again."""
        loop = asyncio.get_running_loop()
        pause_s, logged_reason = _FIRST_PAUSE_S, ""
        while True:
            started_s = loop.time()
            try:
                await self._serve_one_connection()
            except (OSError, MqttUnavailable) as error:
                reason = str(error) or type(error).__name__
            if loop.time() - started_s > _LONGEST_PAUSE_S:
                pause_s, logged_reason = _FIRST_PAUSE_S, ""
            if reason != logged_reason:
                logged_reason = reason
                who = {"client_id": self._name, "reason": reason}
                log.warning("no connection to the broker", extra=who)
            await asyncio.sleep(pause_s * random.uniform(0.5, 1.0))  # noqa: S311 - only jitter
            pause_s = min(2 * pause_s, _LONGEST_PAUSE_S)

    async def _serve_one_connection(self) -> Never:
        link = MqttConnection(self._login, will=self._ask_will(), on_message=self._arrived)
        greeting: asyncio.Task[None] | None = None
        try:
            async with asyncio.timeout(_CONNECT_TIMEOUT_S):
                self._broker = next(self._brokers)
                await link.open(self._broker, self._tls)
                await self._renew_subscriptions(link)
            self._link = link
            self._lost.clear()
            greeting = asyncio.create_task(self._greet())
            while not link.lost.done():
                await self._renew_subscriptions(link)
                self._connected.set()
                await link.lost_or(self._has_new_inbox)
            raise MqttUnavailable(link.lost.result())
        finally:
            self._link = None
            self._lost.set()
            self._connected.clear()
            self._subscribed = 0
            if greeting is not None:
                greeting.cancel()
            link.close()

    def _ask_will(self) -> RawMessage | None:
        if self._will is None:
            return None
        address, message = self._will()
        topic = address.topic
        return self._sealed(address.name, _payload(message), topic.mqtt_qos, topic.retained)

    def _sealed(self, name: str, payload: bytes, mqtt_qos: int, retained: bool) -> RawMessage:
        return RawMessage(name, self._seal.sealed(name, payload), mqtt_qos, retained)

    async def _renew_subscriptions(self, link: MqttConnection) -> None:
        """Subscribe for every inbox that this connection does not serve yet."""
        while self._subscribed < len(self._inboxes):
            fresh = self._inboxes[self._subscribed :]
            self._subscribed = len(self._inboxes)
            most_qos = self._broker.most_qos
            filters = {
                name: min(qos, most_qos) for inbox in fresh for name, qos in inbox.filters.items()
            }
            await link.subscribe(filters)
        self._has_new_inbox.clear()

    async def _greet(self) -> None:
        """Run `on_connected` until it succeeds, or until the connection is lost."""
        if self._on_connected is None:
            return
        missing = MissingParts(f"greeting of {self._name}")
        for failures in itertools.count(1):
            try:
                await self._on_connected()
            except MqttUnavailable:
                return  # it runs again on the next connection
            except ServiceUnavailable as error:
                missing.note(error)
                await asyncio.sleep(pause_s(failures))
            else:
                missing.are_back()
                return


def _unguessable(client_id: str, password: str) -> str:
    digest = hashlib.sha256(f"{client_id}:{password}".encode()).hexdigest()
    return f"{client_id}-{digest[:_ID_DIGITS]}"


def _payload(message: BaseModel) -> bytes:
    return message.model_dump_json().encode()
