"""All fleets in memory, as the database knows them when they are looked at.

Reading and parsing every drone for each request costs more than all else. So what was read is kept,
and a look reads what has changed since: by any replica, since every write leaves its number
(`changes`). Looks that come while one is under way share the next one.
"""

import asyncio
from collections.abc import Mapping

from skyway.drone.model import DroneModel
from skyway.ids import DroneModelId
from skyway.runtime.database import Database
from skyway_provider_registry.candidates import store
from skyway_provider_registry.candidates.fleet_columns import Fleet, FleetColumns
from skyway_provider_registry.changes.store import ChangeMarks, marks
from skyway_provider_registry.fleets.drone_models import store as drone_models


class FleetView:
    """What selection looks at; `look` before every use."""

    def __init__(self, db: Database) -> None:
        self._db = db
        self._seen: ChangeMarks | None = None
        self._models: Mapping[DroneModelId, DroneModel] = {}
        self._fleet = Fleet({}, FleetColumns())
        self._looking = asyncio.Lock()
        # Looks are counted when they begin, and again when they have succeeded.
        self._begun = self._finished = 0

    async def look(self) -> Fleet:
        """The fleets with all that was committed before this call; to be used without waiting."""
        begun_before = self._begun
        async with self._looking:
            if self._finished <= begun_before:
                self._begun += 1
                await self._read_changes()
                self._finished = self._begun
        return self._fleet

    async def _read_changes(self) -> None:
        async with self._db.read() as connection:
            # First of all: what is committed while we read on is read again the next time.
            now = await marks(connection)
            if now == self._seen:
                return
            known, columns = self._fleet.providers, self._fleet.columns
            if self._seen is None or now.providers > self._seen.providers:
                known = await store.known_providers(connection)
            if self._seen is None or now.removals > self._seen.removals:
                columns, rows = FleetColumns(), await store.every_drone(connection)
            else:
                rows = await store.changed_drones(connection, since=self._seen.latest)
            if any(row.model_id not in self._models for row in rows):
                self._models = await drone_models.every(connection)
        columns.put(store.known_drone(row, self._models) for row in rows)
        self._fleet = Fleet(known, columns)
        self._seen = now
