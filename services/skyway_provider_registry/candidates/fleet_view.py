"""All fleets in memory, as the database knows them when they are looked at.

Reading and parsing every drone for each request costs more than all else. So what was read is kept,
and a look reads what has changed since: by any replica, since every write leaves its number
(`changes`). Looks that come while one is under way, or soon after, share the next one.
"""

import asyncio
from collections.abc import Mapping
from typing import Final

from skyway.announced_networks.known_networks import KnownNetworks
from skyway.drone.model import DroneModel
from skyway.ids import DroneModelId
from skyway.runtime.pace import Pace
from skyway.runtime.sql.database import Database
from skyway_provider_registry.candidates import store
from skyway_provider_registry.candidates.fleet_columns import Fleet, FleetColumns
from skyway_provider_registry.change_store import ChangeMarks
from skyway_provider_registry.fleets import drone_model_store as drone_models

#: Before the first change.
_NOTHING_SEEN: Final = -1


class FleetView:
    """What selection looks at; `look` before every use."""

    def __init__(self, db: Database, networks: KnownNetworks, pace: Pace) -> None:
        self._db = db
        self._pace = pace
        self._seen: ChangeMarks | None = None
        self._models: Mapping[DroneModelId, DroneModel] = {}
        self._fleet = Fleet({}, FleetColumns(networks))
        self._looking = asyncio.Lock()
        # Looks are counted when they begin, and again when they have succeeded.
        self._begun = self._finished = 0

    async def look(self) -> Fleet:
        """The fleets with all that was committed before this call; to be used without waiting."""
        begun_before = self._begun
        async with self._looking:
            if self._finished <= begun_before:
                await self._pace.turn()
                self._begun += 1
                await self._read_changes()
                self._finished = self._begun
        return self._fleet

    async def _read_changes(self) -> None:
        seen, known, columns = self._seen, self._fleet.providers, self._fleet.columns
        async with self._db.read() as connection:
            since = _NOTHING_SEEN if seen is None else seen.latest
            # First of all: what is committed while we read on is read again the next time.
            now, rows = await store.changed_drones(connection, since=since)
            if now == seen:
                return
            if seen is None or now.providers > seen.providers:
                known = await store.known_providers(connection)
            if seen is not None and now.removals > seen.removals:
                columns, rows = FleetColumns(columns.networks), await store.every_drone(connection)
            if any(row.drone_id not in columns for row in rows):
                self._models = await drone_models.every(connection)
        columns.put(store.known_drone(row, self._models) for row in rows)
        self._fleet = Fleet(known, columns)
        self._seen = now
