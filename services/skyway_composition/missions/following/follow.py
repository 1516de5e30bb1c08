"""Following missions: one transaction handles one batch of messages from drones.

Messages come late, twice, out of order or not at all. Each kind has its own defence. An ack answers
an instruction once. Events are handled in the order of their `seq`, and requested again when one is
missing. States and connections only replace older ones. So a batch may be handled again, and every
replica may read all messages.

An idle drone that repeats its state causes no transaction (`links.cached_links`).
"""

import asyncio
import logging
from collections import defaultdict
from collections.abc import AsyncIterator, Iterator, Sequence
from dataclasses import replace
from typing import Any, Final, Protocol

from skyway.contracts.drone_report import Ack, Connection, DroneEvent, DroneState
from skyway.contracts.topics import ACKS, CONNECTION, EVENTS, STATE, Topic
from skyway.ids import DroneId, ProviderId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.loops import Wake, repeat
from skyway.runtime.metrics import count
from skyway.runtime.minting import Mint
from skyway.runtime.mqtt.client import Received
from skyway.runtime.mqtt.inbox import BATCH_SIZE
from skyway.runtime.sql.database import Database
from skyway_composition.links.link import CachedLinks, DroneLink
from skyway_composition.links.listening import Listening
from skyway_composition.links.store import lock_link
from skyway_composition.missions.following.handle_ack import handle_ack
from skyway_composition.missions.following.handle_report import handle_event, handle_state
from skyway_composition.missions.following.plausibility import is_ahead
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork

log = logging.getLogger(__name__)

#: A batch that fails this often is handled message by message, so that one bad message is dropped
#: alone: drones repeat what matters, and other drones must not wait.
_TRIES = 3

#: How far a message may be ahead of our clock, fleet and wall seconds. Our own choice.
_AHEAD_S: Final = (30.0, 5.0)

#: Seconds of wall time between two batches: messages that arrive meanwhile share one transaction.
#: A drone often sends an acknowledgement and two states about the same change.
_PAUSE_S = 0.1


class Subscriber(Protocol):
    """The part of an MQTT client that following needs."""

    def batches(self, *subscriptions: Topic[Any]) -> AsyncIterator[list[Received[Any]]]:
        """All messages on these topics; they have no common type."""
        ...


class Follower:
    """Handles messages of drones.

    Wakes `stuck` when a mission needs a new revision, and `calendars` when a drone is free.
    """

    def __init__(
        self,
        db: Database,
        mqtt: Subscriber,
        *,
        clock: FleetClock,
        mint: Mint,
        stuck: Wake,
        calendars: Wake,
        listening: Listening,
    ) -> None:
        self._db = db
        self._clock = clock
        self._mint = mint
        self._stuck = stuck
        self._calendars = calendars
        self._listening = listening
        self._cached_links = CachedLinks(clock)
        self._batches = mqtt.batches(ACKS, EVENTS, STATE, CONNECTION)
        self._batch: list[Received[Any]] = []
        self._tries = 0

    async def run(self) -> None:
        """Handle batches until cancelled."""
        await repeat("follow", self.step, every_s=1.0)

    async def step(self) -> bool:
        """Handle the next batch. Always True: this method itself waits for the next batch."""
        if not self._batch:
            self._batch, self._tries = self._without_ahead(await anext(self._batches)), 0
        self._listening.begin_batch()
        self._tries += 1
        try:
            if self._tries <= _TRIES:
                await self.handle(self._batch)
            else:
                await self._handle_one_by_one()
        except ServiceUnavailable:
            self._tries -= 1  # The batch did not cause this error.
            raise
        is_full, self._batch = len(self._batch) >= BATCH_SIZE, []
        if not is_full:
            self._listening.end_batch()
            await asyncio.sleep(_PAUSE_S)
        return True

    def _without_ahead(self, batch: Sequence[Received[Any]]) -> list[Received[Any]]:
        """The batch without messages about the future: nobody knows whether they will be true.

        A drone whose clock is ahead repeats its events when it is asked; they count when their time
        has come.
        """
        margin = fleet_margin(self._clock, fleet_s=_AHEAD_S[0], wall_s=_AHEAD_S[1])
        latest_at = self._clock.now() + margin
        kept = [each for each in batch if not is_ahead(each.message, latest_at=latest_at)]
        if len(kept) < len(batch):
            doubtful = {each.ids for each in batch} - {each.ids for each in kept}
            log.warning("messages about the future dropped", extra={"drones": sorted(doubtful)})
            count(
                "skyway_messages_ahead",
                "drone messages dropped because they speak of the future",
                len(batch) - len(kept),
            )
        return kept

    async def _handle_one_by_one(self) -> None:
        """Handle each message of a failing batch alone; only those that fail again are dropped.

        Raises
        ------
        ServiceUnavailable
            The database went away; the remaining messages stay in the batch.
        """
        while self._batch:
            received = self._batch[0]
            try:
                await self.handle([received])
            except ServiceUnavailable:
                raise
            except Exception:
                log.exception(
                    "message dropped",
                    extra={"topic": received.topic.template, "ids": received.ids},
                )
                count("skyway_dropped_messages", "drone messages dropped because handling failed")
                # The message may have been an answer, so silence proves nothing from here on.
                self._listening.begin()
            del self._batch[0]

    async def handle(self, batch: Sequence[Received[Any]]) -> None:
        """Handle messages of any kind, in the order of their arrival."""
        batch = await self._without_repeated(batch)
        if not batch:
            return
        writers = {DroneId(each.ids[1]): ProviderId(each.ids[0]) for each in reversed(batch)}
        self._cached_links.forget(writers)
        async with self._db.write() as tx:
            work = await MissionUnitOfWork.lock(writers, tx=tx, clock=self._clock, mint=self._mint)
            # In sorted order, as every transaction locks links.
            for drone_id in sorted(writers.keys() - work.links.keys()):
                work.links[drone_id] = await lock_link(tx, drone_id, writers[drone_id])
            for received in _without_superseded(batch):
                await self._handle_one(work, received)
            await work.save_staged()
            if any(record.needs_plan for record in work.missions.values()):
                tx.after_commit(self._stuck.set)
            if writers.keys() - work.missions.keys():
                tx.after_commit(self._calendars.set)
        self._cached_links.keep(work.links.values())

    async def _without_repeated(self, batch: Sequence[Received[Any]]) -> Sequence[Received[Any]]:
        """The batch without the drones that only repeat their last messages."""
        said: dict[DroneId, list[Received[Any]]] = defaultdict(list)
        for received in batch:
            said[DroneId(received.ids[1])].append(received)
        again = {each for each in said if self._cached_links.changes_nothing(each, said[each])}
        if not again:
            return batch
        async with self._db.read() as connection:
            # For a drone on a mission the time of its last message matters: it must be saved.
            again -= await store.live_among(connection, again)
        for drone_id in again:
            self._cached_links.note(drone_id, said[drone_id])
        return [each for each in batch if DroneId(each.ids[1]) not in again]

    async def ask_live_drones(self) -> None:
        """Ask every drone on a mission for its missing events, after a connection was lost."""
        async with self._db.read() as connection:
            drone_ids = await store.live_drones(connection)
        for drone_id in drone_ids:
            async with self._db.write() as tx:
                work = await MissionUnitOfWork.lock(
                    [drone_id], tx=tx, clock=self._clock, mint=self._mint
                )
                if drone_id in work.missions:
                    await work.courier.ask_for_events(tx, work.links[drone_id])

    async def _handle_one(self, work: MissionUnitOfWork, received: Received[Any]) -> None:
        provider_id, drone_id = ProviderId(received.ids[0]), DroneId(received.ids[1])
        link = work.links[drone_id]
        if link.provider_id != provider_id:
            # The topic may name any provider; only the drone's own provider is accepted.
            count("skyway_foreign_provider", "messages under another provider's name")
            return
        match received.message:
            case Ack() as ack:
                await handle_ack(work, link, ack)
            case DroneEvent() as event:
                await handle_event(work, link, event)
            case DroneState() as state:
                await handle_state(work, link, state)
            case Connection() as connection:
                _handle_connection(work, link, connection)


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


def _handle_connection(work: MissionUnitOfWork, link: DroneLink, connection: Connection) -> None:
    if link.is_newer_connection(connection):
        work.stage_link(replace(link, connection=connection))
