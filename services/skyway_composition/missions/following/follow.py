"""Following missions: what arrives from drones is judged, and handled in batches.

A batch that fails is tried again, and then handled message by message. Messages that cannot be
handled are set aside (`skyway_composition.quarantine`); the other messages of their batch are
handled.

Each replica follows its own drones. When another replica is gone, this replica follows more drones,
and asks for the messages that it has missed.
"""

import asyncio
import logging
from collections import defaultdict
from collections.abc import AsyncIterator, Callable, Sequence
from datetime import UTC, datetime
from functools import partial
from typing import Any, Protocol

from skyway.contracts.topics import Topic
from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.loops import repeat
from skyway.runtime.metrics import count
from skyway.runtime.mqtt.client import Received
from skyway.runtime.mqtt.inbox import BATCH_SIZE, Doorkeeper
from skyway.runtime.mqtt.moments import earliest_believed, latest_believed
from skyway.runtime.replicas.membership import Membership
from skyway_composition.links.listening import Listening
from skyway_composition.missions.following.handle_batch import FOLLOWED_TOPICS, ReportHandler
from skyway_composition.missions.following.plausibility import is_ahead, is_behind
from skyway_composition.quarantine.set_aside import Quarantine

log = logging.getLogger(__name__)

#: A batch that fails this often is handled message by message, so that one bad message is set aside
#: alone: drones repeat what matters, and other drones must not wait.
_TRIES = 3

#: Seconds of wall time between two batches: messages that arrive meanwhile share one transaction.
#: A drone often sends an acknowledgement and two states about the same change. The pause grows with
#: the number of replicas, up to the second value, so that together they begin few transactions.
_PAUSE_S, _LONGEST_PAUSE_S = 0.1, 0.3

#: The longest wait for drones of a replica that is gone, seconds of wall time; then it waits again.
_LONGEST_WAIT_S = 60.0


class Subscriber(Protocol):
    """The part of an MQTT client that following needs."""

    def batches(
        self, *subscriptions: Topic[Any], doorkeeper: Doorkeeper
    ) -> AsyncIterator[list[Received[Any]]]:
        """All messages on these topics; they have no common type."""
        ...


class Follower:
    """Reads the messages of drones, and passes on those that are not set aside."""

    def __init__(
        self,
        handler: ReportHandler,
        mqtt: Subscriber,
        *,
        doorkeeper: Doorkeeper,
        clock: FleetClock,
        quarantine: Quarantine,
        listening: Listening,
    ) -> None:
        self._handler = handler
        self._clock = clock
        self._quarantine = quarantine
        self._listening = listening
        self._batches = mqtt.batches(*FOLLOWED_TOPICS, doorkeeper=doorkeeper)
        self._batch: list[Received[Any]] = []
        self._tries = 0

    async def run(self) -> None:
        """Handle batches until cancelled."""
        await repeat("follow", self.step, every_s=1.0)

    async def step(self) -> bool:
        """Handle the next batch. Always True: this method itself waits for the next batch."""
        if not self._batch:
            self._batch, self._tries = self._of_now(await anext(self._batches)), 0
        self._listening.begin_batch()
        self._tries += 1
        try:
            if self._tries <= _TRIES:
                await self._handle_batch()
            else:
                await self._handle_one_by_one()
        except ServiceUnavailable:
            self._tries -= 1  # The batch did not cause this error.
            raise
        is_full, self._batch = len(self._batch) >= BATCH_SIZE, []
        if not is_full:
            self._listening.end_batch()
            await asyncio.sleep(min(_PAUSE_S * self._listening.replicas, _LONGEST_PAUSE_S))
        return True

    def _of_now(self, batch: Sequence[Received[Any]]) -> list[Received[Any]]:
        """The batch without messages about the future, and without states of long ago.

        Nobody knows whether the future will be true. A drone whose clock is ahead repeats its
        events when it is asked; they count when their time has come.
        """
        latest_at, earliest_at = latest_believed(self._clock), earliest_believed(self._clock)
        kept = []
        for each in batch:
            if is_ahead(each.message, latest_at=latest_at):
                count("skyway_messages_ahead", "drone messages that speak of the future")
                self._quarantine.add(each, "AHEAD", f"it speaks of a moment after {latest_at}")
            elif is_behind(each.message, earliest_at=earliest_at):
                self._set_aside_old(each, earliest_at)
            else:
                kept.append(each)
        return kept

    def _set_aside_old(self, received: Received[Any], earliest_at: datetime) -> None:
        """Set a state of long ago aside; one that the broker has kept is no fault of its drone."""
        if not received.retained:
            detail = f"it speaks of a moment before {earliest_at}"
            self._quarantine.add(received, "BEHIND", detail)

    async def _handle_batch(self) -> None:
        """Handle the batch; if it fails, only the drones whose own messages fail wait for a retry.

        There is no retry for drones of a provider whose messages have failed lately: others would
        wait for each of them.
        """
        try:
            await self._handler.handle(self._batch)
        except ServiceUnavailable:
            raise
        except Exception:
            self._batch = await self._failing()
            if any(not self._quarantine.has_failed(each.ids) for each in self._batch):
                raise
            await self._handle_one_by_one()

    async def _failing(self) -> list[Received[Any]]:
        """Handle each drone's messages alone; the result is the messages that fail."""
        by_drone: dict[tuple[str, ...], list[Received[Any]]] = defaultdict(list)
        for received in self._batch:
            by_drone[received.ids].append(received)
        if len(by_drone) == 1:
            return self._batch
        failing: list[Received[Any]] = []
        for messages in by_drone.values():
            try:
                await self._handler.handle(messages)
            except ServiceUnavailable:
                raise
            except Exception:
                log.exception("messages of a drone failed", extra={"ids": messages[0].ids})
                failing += messages
        return failing

    async def _handle_one_by_one(self) -> None:
        """Handle each message of a failing batch alone; those that fail again are set aside.

        Raises
        ------
        ServiceUnavailable
            The database went away; the remaining messages stay in the batch.
        """
        while self._batch:
            received = self._batch[0]
            try:
                await self._handler.handle([received])
            except ServiceUnavailable:
                raise
            except Exception as error:
                log.exception(
                    "message set aside",
                    extra={"topic": received.topic.template, "ids": received.ids},
                )
                self._quarantine.add(received, "FAILED", f"{type(error).__name__}: {error}")
            del self._batch[0]


class GainedDrones:
    """Catches up on drones that this replica owns because another replica is gone.

    This replica dropped their messages of the last seconds, and perhaps no replica handled them.
    The broker retains states and connections, instructions are repeated until drones answer, and
    drones keep their events until they are confirmed.
    """

    def __init__(
        self,
        handler: ReportHandler,
        subscribe_again: Callable[[], None],
        *,
        membership: Membership,
        clock: FleetClock,
    ) -> None:
        self._handler = handler
        self._subscribe_again = subscribe_again
        self._membership = membership
        self._clock = clock
        self._caught_up_at = datetime.min.replace(tzinfo=UTC)
        self._is_behind = False

    async def step(self) -> bool:
        """Catch up when this replica gains drones. Always True: this method itself waits."""
        if not self._is_behind and not await self._membership.gained.wait(_LONGEST_WAIT_S):
            return True
        self._is_behind = True
        now, since_at = self._clock.now(), self._caught_up_at
        self._subscribe_again()
        await self._handler.ask_live_drones(partial(self._is_gained, since_at=since_at))
        self._caught_up_at, self._is_behind = now, False
        return True

    def _is_gained(self, drone_id: DroneId, since_at: datetime) -> bool:
        is_ours = self._membership.owns(drone_id)
        return is_ours and not self._membership.has_owned(drone_id, since_at)
