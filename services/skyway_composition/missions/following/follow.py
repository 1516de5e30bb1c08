"""Following missions: what arrives from drones is judged, and handled in batches.

A batch is one transaction. Messages come late, twice, out of order or not at all, and each kind has
its own defence. An ack answers an instruction once. Events are handled in the order of their `seq`,
and requested again when one is missing. States and connections only replace older ones. So a batch
may be handled again, and two replicas may handle the same message. An idle drone that repeats its
state causes no transaction (`CachedLinks`).

A batch that fails is tried again, and then handled message by message. Messages that cannot be
handled are set aside (`skyway_composition.quarantine`).

Each replica follows its own drones. When another replica is gone, this replica follows more drones,
and asks for the messages that it has missed.
"""

import asyncio
import logging
from collections import defaultdict
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from typing import Any, Final, Protocol

from skyway.contracts.drone_report import Ack, Connection, DroneEvent, DroneState
from skyway.contracts.topics import ACKS, CONNECTION, EVENTS, STATE, Topic
from skyway.ids import DroneId, ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.loops import repeat
from skyway.runtime.metrics import count
from skyway.runtime.mqtt.client import Received
from skyway.runtime.mqtt.inbox import BATCH_SIZE, Doorkeeper
from skyway.runtime.mqtt.moments import earliest_believed, latest_believed
from skyway.runtime.replicas.membership import Membership
from skyway.runtime.tracing import in_trace_of
from skyway.units import ms_to_moment
from skyway_composition.context import Context
from skyway_composition.links.link import CachedLinks, DroneLink
from skyway_composition.links.listening import Listening
from skyway_composition.links.store import lock_or_add_links, renewals_of
from skyway_composition.missions.following.handle_ack import handle_ack
from skyway_composition.missions.following.handle_report import handle_event, handle_state
from skyway_composition.missions.following.plausibility import is_ahead, is_behind
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.quarantine.quarantined import QuarantineReason
from skyway_composition.quarantine.set_aside import Quarantine

#: The topics of drones that composition reads; the ids of each are provider and drone.
FOLLOWED_TOPICS: Final[tuple[Topic[Any], ...]] = (ACKS, EVENTS, STATE, CONNECTION)


class SetsAside(Protocol):
    """The part of the quarantine that handling needs."""

    def add(self, received: Received[Any], reason: QuarantineReason, detail: str) -> None:
        """Set aside a message that was read. Any: each topic has messages of its own type."""
        ...

    def suspect(self, ids: tuple[str, ...]) -> None:
        """Note a message that was taken, but that no drone sends often."""
        ...


class ReportHandler:
    """Handles messages of drones.

    Wakes `stuck` when a mission needs a new revision, and `calendars` when a drone is free.
    """

    def __init__(
        self,
        context: Context,
        quarantine: SetsAside,
    ) -> None:
        self._context = context
        self._quarantine = quarantine
        self._cached_links = CachedLinks(context.clock)

    def setting_aside_with(self, quarantine: SetsAside) -> "ReportHandler":
        """The same handler, with the same cache, but with another quarantine."""
        other = copy(self)
        other._quarantine = quarantine
        return other

    async def handle(self, batch: Sequence[Received[Any]]) -> None:
        """Handle messages of any kind, in the order of their arrival."""
        batch = await self._without_repeated(batch)
        if not batch:
            return
        writers = {DroneId(each.ids[1]): ProviderId(each.ids[0]) for each in reversed(batch)}
        self._cached_links.forget(writers)
        async with self._context.db.write() as tx:
            work = await MissionUnitOfWork.lock(self._context, tx, writers)
            if writers.keys() - work.links.keys():
                work.links |= await lock_or_add_links(tx, writers, writers)
            for received in _without_superseded(batch):
                record = work.missions.get(DroneId(received.ids[1]))
                said = received.message.traceparent
                trace = said if record is None else record.traceparent or said
                with in_trace_of(trace, "handle drone message"):
                    await self._handle_one(work, received)
            await work.save_staged()
            if any(record.needs_plan for record in work.missions.values()):
                tx.after_commit(self._context.stuck.set)
            if writers.keys() - work.missions.keys():
                tx.after_commit(self._context.calendars.set)
        self._cached_links.keep(work.links.values())

    async def _without_repeated(self, batch: Sequence[Received[Any]]) -> Sequence[Received[Any]]:
        """The batch without the drones that only repeat their last messages."""
        said: dict[DroneId, list[Received[Any]]] = defaultdict(list)
        for received in batch:
            said[DroneId(received.ids[1])].append(received)
        again = {each for each in said if self._cached_links.changes_nothing(each, said[each])}
        if not again:
            return batch
        async with self._context.db.read() as connection:
            # For a drone on a mission the time of its last message matters: it must be saved.
            again -= await store.live_among(connection, again)
            old = {each for each in again if self._cached_links.have_old(each, said[each])}
            if old:
                # They count as new if the drone has got other credentials since.
                renewed = await renewals_of(connection, old)
                again -= self._cached_links.forget_renewed(renewed)
        for drone_id in again:
            self._cached_links.note(drone_id, said[drone_id])
        return [each for each in batch if DroneId(each.ids[1]) not in again]

    async def ask_live_drones(self, is_asked: Callable[[DroneId], bool]) -> None:
        """Ask these drones on missions for their missing events: some may have come meanwhile."""
        async with self._context.db.read() as connection:
            drone_ids = await store.live_drones(connection)
        for drone_id in filter(is_asked, drone_ids):
            async with self._context.db.write() as tx:
                work = await MissionUnitOfWork.lock(self._context, tx, [drone_id])
                if drone_id in work.missions:
                    await work.courier.ask_for_events(tx, work.links[drone_id])

    async def _handle_one(self, work: MissionUnitOfWork, received: Received[Any]) -> None:
        provider_id, drone_id = ProviderId(received.ids[0]), DroneId(received.ids[1])
        link = work.links[drone_id]
        if link.provider_id != provider_id:
            # The broker lets a drone write under its own provider only: its provider has changed.
            count("skyway_foreign_provider", "messages under another provider's name")
            detail = f"the drone belongs to {link.provider_id}"
            self._quarantine.add(received, "FOREIGN_PROVIDER", detail)
            return
        if self._is_of_earlier_credentials(link, received):
            return
        match received.message:
            case Ack() as ack:
                await handle_ack(work, link, ack)
            case DroneEvent() as event:
                await handle_event(work, link, event)
            case DroneState() as state if link.shows_unlikely_stream(state):
                detail = f"it follows stream {state.stream}; ours is {link.stream}"
                self._quarantine.add(received, "IMPLAUSIBLE", detail)
            case DroneState() as state:
                if link.stream < state.stream:
                    work.tx.after_commit(partial(self._quarantine.suspect, received.ids))
                await handle_state(work, link, state)
            case Connection() as connection if link.is_newer_connection(connection):
                work.stage_link(replace(link, connection=connection))

    def _is_of_earlier_credentials(self, link: DroneLink, received: Received[Any]) -> bool:
        """Whether the broker retained the message from before a renewal of credentials.

        Its sender may have dated it in the near future.
        """
        if link.renewed_ms is None or not received.retained:
            return False
        margin = latest_believed(self._context.clock) - self._context.clock.now()
        return bool(received.message.sent_at <= ms_to_moment(link.renewed_ms) + margin)


def _without_superseded(batch: Sequence[Received[Any]]) -> Iterator[Received[Any]]:
    """The batch without each RECEIVED that is followed by the answer to the same instruction."""
    answered = {
        (*each.ids, each.message.instruction_id)
        for each in batch
        if isinstance(each.message, Ack) and each.message.status != "RECEIVED"
    }
    for each in batch:
        is_news = isinstance(each.message, Ack) and each.message.status == "RECEIVED"
        if not is_news or (*each.ids, each.message.instruction_id) not in answered:
            yield each


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
