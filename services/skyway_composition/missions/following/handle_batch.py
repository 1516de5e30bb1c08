"""Handles batches of messages of drones: one transaction for each batch.

Messages come late, twice, out of order or not at all. Each kind has its own defence. An ack answers
an instruction once. Events are handled in the order of their `seq`, and requested again when one is
missing. States and connections only replace older ones. So a batch may be handled again, and two
replicas may handle the same message.

An idle drone that repeats its state causes no transaction (`links.cached_links`).
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from typing import Any, Final, Protocol

from skyway.contracts.drone_report import Ack, Connection, DroneEvent, DroneState
from skyway.contracts.topics import ACKS, CONNECTION, EVENTS, STATE, Topic
from skyway.ids import DroneId, ProviderId
from skyway.runtime.metrics import count
from skyway.runtime.mqtt.client import Received
from skyway.runtime.mqtt.moments import latest_believed
from skyway.runtime.tracing import in_trace_of
from skyway.units import ms_to_moment
from skyway_composition.context import Context
from skyway_composition.links.cached_links import CachedLinks
from skyway_composition.links.link import DroneLink
from skyway_composition.links.store import lock_or_add_links, renewals_of
from skyway_composition.missions.following.handle_ack import handle_ack
from skyway_composition.missions.following.handle_report import handle_event, handle_state
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.quarantine.quarantined import QuarantineReason

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
            case Connection() as connection:
                _handle_connection(work, link, connection)

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


def _handle_connection(work: MissionUnitOfWork, link: DroneLink, connection: Connection) -> None:
    if link.is_newer_connection(connection):
        work.stage_link(replace(link, connection=connection))
