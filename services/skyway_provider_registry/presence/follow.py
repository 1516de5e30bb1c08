"""Listening to what drones say of themselves: one transaction for all that has arrived."""

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from skyway.contracts.drone_report import Telemetry
from skyway.contracts.topic import Topic
from skyway.contracts.topics import CONNECTION, STATE, TELEMETRY
from skyway.ids import DroneId, ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.metrics import count
from skyway.runtime.mqtt.client import Received
from skyway.runtime.mqtt.inbox import BATCH_SIZE
from skyway.runtime.sql.database import Database
from skyway_provider_registry.presence.newest import newest
from skyway_provider_registry.presence.sighting_store import Heard, record
from skyway_provider_registry.presence.store import owners

#: What drones say of themselves, in the order of their ids {p}, {d}.
PRESENCE_TOPICS: Final[tuple[Topic[Any], ...]] = (CONNECTION, STATE, TELEMETRY)

#: Whoever else wants to know what registered drones measure; it takes the samples and is done.
Samples = Sequence[tuple[DroneId, Telemetry]]
Listener = Callable[[Samples], None]

Batches = AsyncIterator[list[Received[Any]]]  # messages of all three topics


class PresenceFollower:
    """Takes batches one by one; a batch that could not be kept is tried again, not lost.

    After each it waits `pause_s` of wall time: drones in flight tell of themselves every second,
    each at another moment, and a transaction for each would cost far more than what it holds.
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
        self._taken: Sequence[Received[Any]] = ()

    async def step(self) -> bool:
        """Keep the next batch; always True, since waiting for it is all the waiting there is."""
        if not self._taken:
            self._taken = await anext(self._batches)
        self._listener(await self._recorder.record(self._taken))
        is_full = len(self._taken) >= BATCH_SIZE
        self._taken = ()
        if not is_full:
            await asyncio.sleep(self._pause_s)
        return True


@dataclass(frozen=True, slots=True)
class Recorder:
    """Keeps what batches say of registered drones, under the name of their own provider only.

    The broker lets a drone write below any provider's name, so only {d} is to be trusted. Whose a
    drone is never changes, so it is remembered; of a drone that was removed nothing is kept.
    """

    db: Database
    clock: FleetClock
    owners: dict[DroneId, ProviderId] = field(default_factory=dict)

    async def record(self, batch: Sequence[Received[Any]]) -> Samples:
        """Keep the newest of each drone and topic, in one transaction; all samples are returned."""
        await self._find_owners({DroneId(item.ids[1]) for item in batch})
        own = [item for item in batch if self.owners.get(DroneId(item.ids[1])) == item.ids[0]]
        if len(own) < len(batch):
            count(
                "skyway_presence_dropped",
                "messages of drones that are not registered, or not with that provider",
                len(batch) - len(own),
            )
        sightings = newest((DroneId(item.ids[1]), item.message) for item in own)
        if sightings:
            heard = Heard(fleet_at=self.clock.now(), wall_at=self.clock.wall_now())
            async with self.db.write() as tx:
                await record(tx, sightings, heard)
        return [(DroneId(item.ids[1]), item.message) for item in own if item.topic is TELEMETRY]

    async def _find_owners(self, drone_ids: set[DroneId]) -> None:
        new = drone_ids - self.owners.keys()
        if new:
            async with self.db.read() as connection:
                self.owners.update(await owners(connection, new))
