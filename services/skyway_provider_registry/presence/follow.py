"""Listening to what drones say of themselves: one transaction for all that has arrived."""

from collections.abc import AsyncIterator, Sequence
from typing import Any, Final

from skyway.contracts.topic import Topic
from skyway.contracts.topics import CONNECTION, STATE, TELEMETRY
from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database
from skyway.runtime.metrics import count
from skyway.runtime.mqtt import Received
from skyway_provider_registry.presence import store
from skyway_provider_registry.presence.newest import newest

#: What drones say of themselves, in the order of their ids {p}, {d}.
PRESENCE_TOPICS: Final[tuple[Topic[Any], ...]] = (CONNECTION, STATE, TELEMETRY)

Batches = AsyncIterator[list[Received[Any]]]  # messages of all three topics


class PresenceFollower:
    """Takes batches one by one; a batch that could not be kept is tried again, not lost."""

    def __init__(self, batches: Batches, *, db: Database, clock: FleetClock) -> None:
        self._batches = batches
        self._db = db
        self._clock = clock
        self._taken: Sequence[Received[Any]] = ()

    async def step(self) -> bool:
        """Keep the next batch; always True, since waiting for it is all the waiting there is."""
        if not self._taken:
            self._taken = await anext(self._batches)
        await record_batch(self._db, self._taken, clock=self._clock)
        self._taken = ()
        return True


async def record_batch(db: Database, batch: Sequence[Received[Any]], *, clock: FleetClock) -> None:
    """Keep what a batch says of registered drones, under the name of their own provider only.

    The broker lets a drone write below any provider's name, so only {d} is to be trusted.
    """
    async with db.read() as connection:
        owners = await store.owners(connection, [DroneId(item.ids[1]) for item in batch])
    own = [item for item in batch if owners.get(DroneId(item.ids[1])) == item.ids[0]]
    if len(own) < len(batch):
        count(
            "skyway_presence_dropped",
            "messages of drones that are not registered, or not with that provider",
            len(batch) - len(own),
        )
    sightings = newest((DroneId(item.ids[1]), item.message) for item in own)
    if not sightings:
        return
    heard = store.Heard(fleet_at=clock.now(), wall_at=clock.wall_now())
    async with db.write() as tx:
        await store.record(tx, sightings, heard)
