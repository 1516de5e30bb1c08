"""Follows the presence messages of drones: one transaction for each batch."""

import asyncio
import logging
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

from skyway.contracts.drone_report import Telemetry
from skyway.contracts.topics import CONNECTION, STATE, TELEMETRY, Topic
from skyway.ids import DroneId, ProviderId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.metrics import count
from skyway.runtime.mqtt.client import Received
from skyway.runtime.mqtt.inbox import BATCH_SIZE
from skyway.runtime.sql.database import Database
from skyway_provider_registry import renewal_store
from skyway_provider_registry.presence.judge_states import StateJudge
from skyway_provider_registry.presence.jump_store import put_in_maintenance
from skyway_provider_registry.presence.sighting_store import ReceptionTime, newest, record
from skyway_provider_registry.presence.store import owners

log = logging.getLogger(__name__)

#: The topics of presence; the ids of each are {p}, {d}.
PRESENCE_TOPICS: Final[tuple[Topic[Any], ...]] = (CONNECTION, STATE, TELEMETRY)

#: How far a message may be ahead of our clock, fleet and wall seconds. Our own choice.
_AHEAD_S: Final = (30.0, 5.0)

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
    ) -> None:
        self._batches = batches
        self._pause_s = pause_s
        self._listener = listener
        self._recorder = Recorder(db, clock)
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
    owners: dict[DroneId, ProviderId] = field(default_factory=dict)

    @cached_property
    def judge(self) -> StateJudge:
        """Finds the drones that jump."""
        return StateJudge(self.db, self.clock)

    async def record(self, batch: Sequence[Received[Any]]) -> Samples:
        """Store the newest message per drone and topic; the result is all samples."""
        await self._find_owners({DroneId(item.ids[1]) for item in batch})
        batch = await self._without_earlier_credentials(batch)
        own = [item for item in batch if self.owners.get(DroneId(item.ids[1])) == item.ids[0]]
        if len(own) < len(batch):
            _count_dropped(len(batch) - len(own))
        sightings = newest((DroneId(item.ids[1]), item.message) for item in own)
        if sightings:
            states = {
                drone_id: each.state
                for drone_id, each in sightings.items()
                if each.state is not None
            }
            alarms = await self.judge.alarms_about(states, self.owners)
            received_at = ReceptionTime(fleet_at=self.clock.now(), wall_at=self.clock.wall_now())
            async with self.db.write() as tx:
                await record(tx, sightings, received_at)
                await put_in_maintenance(tx, alarms)
        return [(DroneId(item.ids[1]), item.message) for item in own if item.topic is TELEMETRY]

    async def _without_earlier_credentials(
        self, batch: Sequence[Received[Any]]
    ) -> Sequence[Received[Any]]:
        """The batch without what the broker has kept from before a renewal of credentials."""
        retained = {DroneId(item.ids[1]) for item in batch if item.retained}
        if not retained:
            return batch
        async with self.db.read() as connection:
            renewed = await renewal_store.renewed_at(connection, retained)
        # Its sender may have said that it is from the near future.
        margin = fleet_margin(self.clock, fleet_s=_AHEAD_S[0], wall_s=_AHEAD_S[1])
        latest_at = self.clock.now() + margin
        return [
            item
            for item in batch
            if not item.retained
            or (since_at := renewed.get(DroneId(item.ids[1]))) is None
            or since_at + margin < item.message.sent_at <= latest_at
        ]

    async def _find_owners(self, drone_ids: set[DroneId]) -> None:
        new = drone_ids - self.owners.keys()
        if new:
            async with self.db.read() as connection:
                self.owners.update(await owners(connection, new))


def _count_dropped(messages: int) -> None:
    count(
        "skyway_presence_dropped",
        "messages of drones that are not registered with that provider, or that cannot be stored",
        messages,
    )
