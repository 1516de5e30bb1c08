"""All fleets in memory as columns, refreshed from the database before each use.

Reading every drone for each request would cost more than everything else. So the fleets stay in
memory, and a refresh reads only the changes since the last one. Changes of other replicas are found
too, because every write stores its number (`change_store`). Refreshes that are requested while one
runs, or soon after, share the next one. numpy compares a request with thousands of drones by their
columns.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from skyway.announced_networks import CachedNetworks
from skyway.contracts.drones import DronesOfModel, NetworkDrones
from skyway.drone.model import DroneModel
from skyway.geo import unit_vector
from skyway.ids import DroneId, DroneModelId, NetworkId, ProviderId, StationId
from skyway.runtime.loops import Pace
from skyway.runtime.sql.database import Database
from skyway_provider_registry.candidates import store
from skyway_provider_registry.candidates.reasons import CachedDrone, CachedProvider
from skyway_provider_registry.change_store import ChangeMarks
from skyway_provider_registry.fleets.store import every_model

#: One drone; `x`, `y`, `z` are its direction from the Earth's centre.
_DRONE: Final = np.dtype(
    [
        ("provider", np.int32),
        ("model", np.int32),
        ("station", np.int32),
        ("home", np.int32),
        ("network", np.int32),
        ("home_network", np.int32),
        ("payload_kg", np.float64),
        ("soc", np.float64),
        ("x", np.float64),
        ("y", np.float64),
        ("z", np.float64),
        ("online_until_ms", np.int64),
        ("free_ms", np.int64),
        ("speed_mps", np.float64),
        ("is_busy", np.bool_),
        ("is_low", np.bool_),
    ]
)
#: Rows of the first table; a full table is doubled.
_FIRST_CAPACITY: Final = 256
#: The value of the columns `station` and `network` for a drone that is at no known place.
NOWHERE: Final = -1

Columns = npt.NDArray[np.void]
Rows = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]

#: Before the first change.
_NOTHING_SEEN: Final = -1


@dataclass(slots=True)
class FleetColumns:
    """The drones by row, and the strongest model of each provider; ties are broken by id."""

    networks: CachedNetworks
    drones: list[CachedDrone] = field(default_factory=list)
    models: dict[DroneModelId, DroneModel] = field(default_factory=dict)
    strongest: dict[ProviderId, DroneModel] = field(default_factory=dict)
    _rows: dict[DroneId, int] = field(default_factory=dict)
    _providers: dict[ProviderId, int] = field(default_factory=dict)
    _model_numbers: dict[DroneModelId, int] = field(default_factory=dict)
    _stations: dict[StationId, int] = field(default_factory=dict)
    _networks: dict[NetworkId, int] = field(default_factory=dict)
    _networks_seen: int = -1  # the revision when the column `network` was last written
    _table: Columns = field(default_factory=lambda: np.zeros(_FIRST_CAPACITY, _DRONE))
    _order: Rows | None = None

    def put(self, drones: Iterable[CachedDrone]) -> None:
        """Store the current data of these drones; new drones get new rows."""
        for drone in drones:
            row = self._rows.get(drone.drone_id)
            if row is None:
                row = self._rows[drone.drone_id] = len(self.drones)
                self.drones.append(drone)
                self._order = None
                self._compare(drone.provider_id, drone.model)
                if row == len(self._table):
                    self._table = np.concatenate((self._table, np.zeros_like(self._table)))
            self.drones[row] = drone
            self._table[row] = self._row_of(drone)

    def __contains__(self, drone_id: DroneId) -> bool:
        return drone_id in self._rows

    def column(self, name: str) -> npt.NDArray[Any]:  # each column has a type of its own
        """One column of all drones: a view, which is valid until the next `put`."""
        column: npt.NDArray[Any] = self._table[name][: len(self.drones)]
        return column

    def rows_of(self, drone_ids: Iterable[DroneId]) -> list[int]:
        """The rows of these drones; unknown drones are left out."""
        return [self._rows[one] for one in drone_ids if one in self._rows]

    def station(self, station_id: StationId) -> int:
        """The value of the column `station` for this station; -2 if no drone was ever there."""
        return self._stations.get(station_id, NOWHERE - 1)

    def elsewhere(self, station_id: StationId) -> Flags:
        """The drones that stand in another network than this station, as far as we know."""
        self._keep_networks()
        network, here = self.column("network"), self._network_of(station_id)
        if here == NOWHERE:
            return np.zeros(len(network), np.bool_)
        others: Flags = (network != here) & (network != NOWHERE)
        return others

    def network_or_home(self) -> npt.NDArray[np.int32]:
        """By row: the network where the drone stands; in the air, the network of its home."""
        self._keep_networks()
        network, of_home = self.column("network"), self.column("home_network")
        found: npt.NDArray[np.int32] = np.where(network == NOWHERE, of_home, network)
        return found

    def network(self, network_id: NetworkId) -> int:
        """The value of the column `network` for this network; -2 if no drone was ever in it."""
        return self._networks.get(network_id, NOWHERE - 1)

    @property
    def providers(self) -> Mapping[ProviderId, int]:
        """The value of the column `provider`, by provider."""
        return self._providers

    def with_models(self, is_able: Callable[[DroneModel], bool]) -> Flags:
        """Which drones have a model of this kind."""
        able = [
            number
            for model_id, number in self._model_numbers.items()
            if is_able(self.models[model_id])
        ]
        return np.isin(self.column("model"), able)

    @property
    def order(self) -> Rows:
        """The rank of each row among all drone ids, which breaks every tie."""
        if self._order is None:
            ids = [drone.drone_id for drone in self.drones]
            ranks = np.empty(len(ids), np.intp)
            ranks[sorted(range(len(ids)), key=ids.__getitem__)] = np.arange(len(ids))
            self._order = ranks
        return self._order

    def _compare(self, provider_id: ProviderId, model: DroneModel) -> None:
        strongest = self.strongest.setdefault(provider_id, model)
        self.strongest[provider_id] = min(
            (strongest, model), key=lambda one: (-one.max_payload_kg, one.model_id)
        )

    def _keep_networks(self) -> None:
        """Write the networks of all drones again if the cached networks have changed."""
        if self._networks_seen == self.networks.revision:
            return
        # The last entry is for drones that stand at no station.
        by_station = np.array([*map(self._network_of, self._stations), NOWHERE])
        self.column("network")[:] = by_station[self.column("station")]
        self.column("home_network")[:] = by_station[self.column("home")]
        self._networks_seen = self.networks.revision

    def _network_of(self, station_id: StationId | None) -> int:
        """The value of the column `network` for drones at this station."""
        network_id = None if station_id is None else self.networks.network_of(station_id)
        if network_id is None:
            return NOWHERE
        return self._networks.setdefault(network_id, len(self._networks))

    def _station_number(self, station_id: StationId) -> int:
        return self._stations.setdefault(station_id, len(self._stations))

    def _row_of(self, drone: CachedDrone) -> tuple[object, ...]:
        station, model_id = drone.station_id, drone.model.model_id
        self.models[model_id] = drone.model
        return (
            self._providers.setdefault(drone.provider_id, len(self._providers)),
            self._model_numbers.setdefault(model_id, len(self._model_numbers)),
            NOWHERE if station is None else self._station_number(station),
            self._station_number(drone.home_station_id),
            self._network_of(station),
            self._network_of(drone.home_station_id),
            drone.model.max_payload_kg,
            drone.soc,
            *unit_vector(drone.position),
            drone.online_until_ms,
            drone.free_ms,
            drone.model.speed_empty_mps,
            drone.is_busy or station is None,
            drone.soc < drone.model.reserve_soc,
        )


@dataclass(frozen=True, slots=True)
class Fleet:
    """All providers and their drones."""

    providers: Mapping[ProviderId, CachedProvider]
    columns: FleetColumns


class FleetView:
    """The fleets that selection works on; call `refreshed` before every use."""

    def __init__(self, db: Database, networks: CachedNetworks, pace: Pace) -> None:
        self._db = db
        self._pace = pace
        self._seen: ChangeMarks | None = None
        self._models: Mapping[DroneModelId, DroneModel] = {}
        self._fleet = Fleet({}, FleetColumns(networks))
        self._refreshing = asyncio.Lock()
        self._reading = asyncio.Lock()
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

    @asynccontextmanager
    async def unchanged(self) -> AsyncIterator[Fleet]:
        """The fleets as `refreshed` finds them; they stay so until the end of the block."""
        await self.refreshed()
        async with self._reading:
            yield self._fleet

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
                self._models = await every_model(connection)
        networks = columns.networks
        async with self._reading:
            columns.put(store.cached_drone(row, self._models, networks) for row in rows)
            self._fleet = Fleet(providers, columns)
            self._seen = now


def count_drones(fleet: Fleet, network_id: NetworkId, *, wall_now_ms: int) -> NetworkDrones:
    """The drones that stand in this network, or that are in the air and have their home there."""
    columns = fleet.columns
    network = columns.network_or_home()
    here = network == columns.network(network_id)
    is_online = here & (columns.column("online_until_ms") >= wall_now_ms)
    is_idle = is_online & ~columns.column("is_busy") & ~columns.column("is_low")
    # A drone that is free later counts as busy now.
    is_idle &= columns.column("free_ms") == 0
    of_model = columns.column("model")
    counts = [
        np.bincount(of_model[rows], minlength=len(columns.models))
        for rows in (here, is_online, is_idle)
    ]
    by_model = zip(columns.models.values(), *(each.tolist() for each in counts), strict=True)
    found = [
        DronesOfModel(
            model_id=model.model_id,
            max_payload_kg=model.max_payload_kg,
            model=model,
            registered=registered,
            online=online,
            idle=idle,
        )
        for model, registered, online, idle in by_model
        if registered
    ]
    return NetworkDrones(
        models=tuple(sorted(found, key=lambda each: each.model_id)),
        unplaced=int(np.count_nonzero(network == NOWHERE)),
    )
