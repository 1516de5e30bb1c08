"""The messages that have arrived for one reader: kept in order, read in typed batches."""

import asyncio
import logging
import time
from collections import deque
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from typing import Any, Final, Generic, Protocol, TypeVar

from pydantic import ValidationError

from skyway.contracts.topics import TOPICS, Address, Topic
from skyway.runtime.metrics import count

log = logging.getLogger(__name__)

#: The most messages in one batch: receivers write one transaction per batch.
BATCH_SIZE: Final = 500
#: The most messages of mqtt_qos 0 that wait for a reader: about 20 MiB of samples.
MOST_LIGHT: Final = 20_000

#: A whole topic, or one address of it. Any: each topic has a message type of its own.
Subscription = Topic[Any] | Address[Any]

R = TypeVar("R")  # what is received: one message class, or Any of several


@dataclass(frozen=True, slots=True)
class Received(Generic[R]):
    """A message that has arrived; `ids` are the topic's placeholders in order.

    `payload` is what `message` was read from.
    """

    topic: Topic[Any]
    ids: tuple[str, ...]
    message: R
    retained: bool
    payload: bytes = b""


@dataclass(frozen=True, slots=True)
class Arrival:
    """A message that was not read yet; `ids` are the values in `name` of the topic's placeholders.

    `at_s` is the moment of the arrival by `time.monotonic`.
    """

    topic: Topic[Any]
    ids: tuple[str, ...]
    name: str
    payload: bytes
    retained: bool
    at_s: float = 0.0


#: Puts a message back among those that wait for the reader.
ReadAgain = Callable[[Arrival], None]


class Doorkeeper(Protocol):
    """Decides whose messages are read, and gets the messages that cannot be read."""

    def is_ours(self, ids: tuple[str, ...]) -> bool:
        """Whether this process reads messages with these ids; it drops others as they arrive."""

    def is_shut_out(self, ids: tuple[str, ...]) -> bool:
        """Whether to drop the messages with these ids in their topic, unread."""

    def is_proven(self, arrival: Arrival, read_again: ReadAgain) -> bool:
        """Whether to read this message now; the doorkeeper may pass it to `read_again` later."""

    def unreadable(
        self, topic: Topic[Any], ids: tuple[str, ...], payload: bytes, error: ValidationError
    ) -> None:
        """Handle a message that cannot be read; this must return without waiting."""


class Inbox:
    """The subscriptions of one reader and what has arrived on them.

    A message with mqtt_qos 0 may be lost. While the reader is stuck and too many of these messages
    wait, the older half of them is dropped.
    """

    def __init__(
        self, subscriptions: tuple[Subscription, ...], doorkeeper: Doorkeeper | None = None
    ) -> None:
        self._doorkeeper = doorkeeper
        self._subscribed = tuple(
            (subscription.topic, subscription.name, ())
            if isinstance(subscription, Address)
            else (subscription, None, _narrower_than(subscription))
            for subscription in subscriptions
        )
        self._waiting: deque[Arrival] = deque()
        self._light = 0  # how many waiting messages have mqtt_qos 0
        self._has_news = asyncio.Event()
        self._unreadable: set[str] = set()
        _count_shed(0)

    @property
    def filters(self) -> dict[str, int]:
        """What to subscribe to: MQTT filter and `mqtt_qos`."""
        return {name or topic.everywhere: topic.mqtt_qos for topic, name, _ in self._subscribed}

    @property
    def waiting(self) -> int:
        """How many messages wait for the reader."""
        return len(self._waiting)

    @property
    def lag_s(self) -> float:
        """How long the oldest waiting message has waited, seconds of wall time."""
        return time.monotonic() - self._waiting[0].at_s if self._waiting else 0.0

    def offer(self, name: str, payload: bytes, *, retained: bool) -> None:
        """Keep a message if it is on one of our subscriptions."""
        for topic, only, narrower in self._subscribed:
            if only is not None and only != name:
                continue
            ids = topic.ids_in(name)
            # This is asked first, because most messages may be for other replicas.
            if ids is None or not self._is_ours(ids):
                continue
            if all(other.ids_in(name) is None for other in narrower):
                self._add(Arrival(topic, ids, name, payload, retained, time.monotonic()))
                return

    def _is_ours(self, ids: tuple[str, ...]) -> bool:
        return self._doorkeeper is None or self._doorkeeper.is_ours(ids)

    def _add(self, arrival: Arrival) -> None:
        self._waiting.append(arrival)
        self._light += arrival.topic.mqtt_qos == 0
        if self._light > MOST_LIGHT:
            self._drop_older_half()
        self._has_news.set()

    async def batches(self) -> AsyncIterator[list[Received[Any]]]:
        """Everything that has arrived, in order, at most `BATCH_SIZE` messages at a time."""
        while True:
            await self._has_news.wait()
            count = min(len(self._waiting), BATCH_SIZE)
            items = [self._waiting.popleft() for _ in range(count)]
            self._light -= sum(item.topic.mqtt_qos == 0 for item in items)
            if not self._waiting:
                self._has_news.clear()
            batch = [received for item in items if (received := self._read(item)) is not None]
            if batch:
                yield batch

    def _drop_older_half(self) -> None:
        """Drop the older half of the messages of mqtt_qos 0."""
        doomed = self._light // 2
        _count_shed(doomed)
        self._light -= doomed
        for _ in range(len(self._waiting)):
            item = self._waiting.popleft()
            if doomed and item.topic.mqtt_qos == 0:
                doomed -= 1
            else:
                self._waiting.append(item)

    def _read(self, arrival: Arrival) -> Received[Any] | None:
        topic, ids, payload = arrival.topic, arrival.ids, arrival.payload
        if self._doorkeeper is not None and (
            self._doorkeeper.is_shut_out(ids) or not self._doorkeeper.is_proven(arrival, self._add)
        ):
            return None
        try:
            return Received(topic, ids, topic.read(payload), arrival.retained, payload)
        except ValidationError as error:
            count("skyway_mqtt_unreadable", "messages dropped unread", topic=topic.template)
            if self._doorkeeper is not None:
                self._doorkeeper.unreadable(topic, ids, payload, error)
            if topic.template not in self._unreadable:
                self._unreadable.add(topic.template)
                log.warning(
                    "unreadable message dropped, later ones on this topic silently",
                    extra={"topic": topic.template, "ids": ids, "errors": error.error_count()},
                )
            return None


def _count_shed(messages: int) -> None:
    count("skyway_mqtt_shed", "messages of mqtt_qos 0 dropped: their reader is stuck", messages)


def _narrower_than(topic: Topic[Any]) -> tuple[Topic[Any], ...]:
    """The topics that have words where this topic has ids.

    ``skyway/v1/stations/s1/state`` is not the state of drone s1 of provider "stations", though a
    broker delivers it to a subscriber of all drones' states.
    """
    return tuple(
        other for other in TOPICS if other is not topic and topic.ids_in(other.template) is not None
    )
