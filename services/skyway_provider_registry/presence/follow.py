"""Follows the presence messages of drones: one transaction for each batch."""

import asyncio
import logging
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from typing import Any, Final

from skyway.contracts.drone_report import Connection, Telemetry
from skyway.contracts.topics import CONNECTION, STATE, TELEMETRY, Topic
from skyway.ids import DroneId, ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.metrics import count
from skyway.runtime.mqtt.client import Received
from skyway.runtime.mqtt.inbox import BATCH_SIZE
from skyway.runtime.mqtt.moments import earliest_believed, latest_believed
from skyway.runtime.sql.database import Database, Tx
from skyway_provider_registry import change_store
from skyway_provider_registry.presence.judge_states import (
    Judgement,
    StateJudge,
    StationPlace,
    nowhere_known,
)
from skyway_provider_registry.presence.jump_store import keep_waiting, put_in_maintenance
from skyway_provider_registry.presence.learned_store import learn
from skyway_provider_registry.presence.maintenance_store import mark_due
from skyway_provider_registry.presence.sighting_store import (
    PresenceMessage,
    ReceptionTime,
    newest,
    record,
)
from skyway_provider_registry.presence.store import owners
from skyway_provider_registry.presence.wear import maintenance_alarm

log = logging.getLogger(__name__)

#: The topics of presence; the ids of each are {p}, {d}.
PRESENCE_TOPICS: Final[tuple[Topic[Any], ...]] = (CONNECTION, STATE, TELEMETRY)

#: Gets the samples of registered drones; it must return without waiting.
Samples = Sequence[tuple[DroneId, Telemetry]]
Listener = Callable[[Samples], None]

Batches = AsyncIterator[list[Received[Any]]]  # messages of all three topics


class PresenceFollower:
    """Stores batches one by one; a batch is tried again while the database is away.

    A message that cannot be stored for another reason is dropped alone: others must not wait.

    After each batch it waits `pause_s` of wall time. Each drone in flight sends a message every
    second, and a transaction for each message would cost far more than the message.
    """

    def __init__(
        self,
        batches: Batches,
        *,
        db: Database,
        clock: FleetClock,
        pause_s: float = 0.0,
        listener: Listener = lambda _samples: None,
        place_of: StationPlace = nowhere_known,
    ) -> None:
        self._batches = batches
        self._pause_s = pause_s
        self._listener = listener
        self._recorder = Recorder(db, clock, place_of)
        self._batch: Sequence[Received[Any]] = ()

    async def step(self) -> bool:
        """Step of a loop: store the next batch; always True, since this step itself waits."""
        if not self._batch:
            self._batch = await anext(self._batches)
        self._listener(await self._record(self._batch))
        is_full = len(self._batch) >= BATCH_SIZE
        self._batch = ()
        if not is_full:
            await asyncio.sleep(self._pause_s)
        return True

    async def _record(self, batch: Sequence[Received[Any]]) -> Samples:
        try:
            return await self._recorder.record(batch)
        except ServiceUnavailable:
            raise
        except Exception:
            if len(batch) == 1:
                log.exception("message dropped", extra={"ids": batch[0].ids})
                _count_dropped(1)
                return ()
        # The halves find a bad message among 500 in nine steps.
        half = len(batch) // 2
        first = await self._record(batch[:half])
        return (*first, *await self._record(batch[half:]))


@dataclass(frozen=True)
class Recorder:
    """Stores messages of registered drones that arrive under their own provider.

    The broker lets a drone publish under any provider, so only the id {d} can be trusted. A drone's
    provider never changes, so it is cached. Messages of removed drones are not stored.
    """

    db: Database
    clock: FleetClock
    place_of: StationPlace = nowhere_known
    owners: dict[DroneId, ProviderId] = field(default_factory=dict)

    @cached_property
    def judge(self) -> StateJudge:
        """Finds the drones that jump."""
        return StateJudge(self.db, self.clock, self.place_of)

    async def record(self, batch: Sequence[Received[Any]]) -> Samples:
        """Store the newest message per drone and topic; the result is all samples."""
        await self._find_owners({DroneId(item.ids[1]) for item in batch})
        batch = self._of_now(batch)
        batch = await self._without_earlier_credentials(batch)
        own = [item for item in batch if self.owners.get(DroneId(item.ids[1])) == item.ids[0]]
        if len(own) < len(batch):
            _count_dropped(len(batch) - len(own))
        sightings = newest((DroneId(item.ids[1]), item.message) for item in own)
        if sightings:
            judgement = await self.judge.judgement_on(sightings, self.owners)
            received_at = ReceptionTime(fleet_at=self.clock.now(), wall_at=self.clock.wall_now())
            async with self.db.write() as tx:
                await record(tx, sightings, received_at, ahead=judgement.ahead, wear=judgement.wear)
                await self._call_for_maintenance(tx, judgement, received_at)
                await put_in_maintenance(tx, judgement.alarms)
        return [(DroneId(item.ids[1]), item.message) for item in own if item.topic is TELEMETRY]

    async def _call_for_maintenance(
        self, tx: Tx, judgement: Judgement, received_at: ReceptionTime
    ) -> None:
        """Learn from the states, and keep an alarm for each drone that a person must look at."""
        at = received_at.fleet_at
        worse = await learn(tx, judgement.ended, received_at=received_at)
        due = await mark_due(tx, judgement.wear.keys(), at=at)
        for drone_id in sorted(worse.keys() | due.keys()):
            reasons = "; ".join(each[drone_id] for each in (worse, due) if drone_id in each)
            alarm = maintenance_alarm(self.owners[drone_id], drone_id, reasons, at=at)
            await keep_waiting(tx, alarm)

    async def _without_earlier_credentials(
        self, batch: Sequence[Received[Any]]
    ) -> Sequence[Received[Any]]:
        """The batch without what the broker has kept from before a renewal of credentials."""
        retained = {DroneId(item.ids[1]) for item in batch if item.retained}
        if not retained:
            return batch
        async with self.db.read() as connection:
            renewed = await change_store.renewed_at(connection, retained)
        # Its sender may have said that it is from the near future.
        margin = latest_believed(self.clock) - self.clock.now()
        return [
            item
            for item in batch
            if not item.retained
            or (since_at := renewed.get(DroneId(item.ids[1]))) is None
            or since_at + margin < item.message.sent_at
        ]

    def _of_now(self, batch: Sequence[Received[Any]]) -> Sequence[Received[Any]]:
        """The batch without messages about the future, and without what was so long ago."""
        latest_at, earliest_at = latest_believed(self.clock), earliest_believed(self.clock)
        kept = [item for item in batch if _is_between(item.message, earliest_at, latest_at)]
        if len(kept) < len(batch):
            _count_dropped(len(batch) - len(kept))
        return kept

    async def _find_owners(self, drone_ids: set[DroneId]) -> None:
        new = drone_ids - self.owners.keys()
        if new:
            async with self.db.read() as connection:
                self.owners.update(await owners(connection, new))


def _is_between(message: PresenceMessage, earliest_at: datetime, latest_at: datetime) -> bool:
    """Whether a message speaks of a moment between these; a last will may be older."""
    if isinstance(message, Connection):
        return message.sent_at <= latest_at
    moments = message.sent_at, message.at
    return earliest_at <= min(moments) and max(moments) <= latest_at


def _count_dropped(messages: int) -> None:
    count(
        "skyway_presence_dropped",
        "messages of drones that are not registered with that provider, that speak of the future "
        "or of long ago, or that cannot be stored",
        messages,
    )
