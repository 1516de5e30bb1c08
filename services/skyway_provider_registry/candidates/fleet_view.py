"""All fleets in memory, refreshed from the database before each use.

Reading every drone for each request would cost more than everything else. So the fleets stay in
memory, and a refresh reads only the changes since the last one. Changes of other replicas are found
too, because every write stores its number (`change_store`). Refreshes that are requested while one
runs, or soon after, share the next one.
"""

import asyncio
from collections.abc import Mapping
from typing import Final

from skyway.announced_networks import CachedNetworks
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
    """The fleets that selection works on; call `refreshed` before every use."""

    def __init__(self, db: Database, networks: CachedNetworks, pace: Pace) -> None:
        self._db = db
        self._pace = pace
        self._seen: ChangeMarks | None = None
        self._models: Mapping[DroneModelId, DroneModel] = {}
        self._fleet = Fleet({}, FleetColumns(networks))
        self._refreshing = asyncio.Lock()
        # Refreshes are counted when they begin, and again when they have succeeded.
        self._begun = self._finished = 0

    async def refreshed(self) -> Fleet:
        """The fleets with all changes that were committed before this call; use them now."""
        begun_before = self._begun
        async with self._refreshing:
            if self._finished <= begun_before:
                await self._pace.turn()
                self._begun += 1
                await self._read_changes()
                self._finished = self._begun
        return self._fleet

    async def _read_changes(self) -> None:
        seen, providers, columns = self._seen, self._fleet.providers, self._fleet.columns
        async with self._db.read() as connection:
            since = _NOTHING_SEEN if seen is None else seen.latest
            # The marks come first: a change that is committed after this read is read next time.
            now, rows = await store.changed_drones(connection, since=since)
            if now == seen:
                return
            if seen is None or now.providers > seen.providers:
                providers = await store.cached_providers(connection)
            if seen is not None and now.removals > seen.removals:
                columns, rows = FleetColumns(columns.networks), await store.every_drone(connection)
            if any(row.drone_id not in columns for row in rows):
                self._models = await drone_models.every(connection)
        networks = columns.networks
        columns.put(store.cached_drone(row, self._models, networks) for row in rows)
        self._fleet = Fleet(providers, columns)
        self._seen = now
