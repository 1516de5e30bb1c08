"""The keys of drones from the registry's own database, for its own followers of messages."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from skyway.contracts.drones import DroneSignature
from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.signing.key_book import CHANGES_NAMED_FOR
from skyway.runtime.sql.database import Database
from skyway_provider_registry.enrolment import signing_store


@dataclass(frozen=True, slots=True)
class StoredKeys:
    """`KeySource` of the database."""

    db: Database
    clock: FleetClock

    async def of(self, drone_ids: Collection[DroneId]) -> Sequence[DroneSignature]:
        """How each of these drones signs; one that is not registered is left out."""
        async with self.db.read() as connection:
            return await signing_store.signatures_of(connection, drone_ids)

    async def changed(self) -> Sequence[DroneSignature]:
        """How the drones sign whose credentials have changed within a minute."""
        since_wall_at = self.clock.wall_now() - CHANGES_NAMED_FOR
        async with self.db.read() as connection:
            return await signing_store.changed_since(connection, since_wall_at=since_wall_at)
