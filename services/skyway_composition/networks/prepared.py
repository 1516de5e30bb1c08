"""Networks prepared for planning, cached in memory by network and version, as parsing is slow.

A version never changes, so the cache never goes stale. Which version is current is read each time.
"""

import asyncio
import logging
import time
from dataclasses import dataclass
from typing import Final

import numpy as np

from skyway.contracts.network_document import NetworkSettings, settings_of
from skyway.ids import NetworkId, StationId
from skyway.network.columns import Floats
from skyway.network.geojson_text import read_network_text
from skyway.network.great_circle import distances_m
from skyway.network.network import Network
from skyway.planner.airspace import Airspace
from skyway.planner.hierarchy import Hierarchy
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.sql.database import Database
from skyway_composition.closures.conditions import CachedConditions
from skyway_composition.networks import store
from skyway_composition.networks.pickup_store import PastPickups
from skyway_composition.networks.store import VersionRow
from skyway_composition.own_cells import OwnCells

log = logging.getLogger(__name__)

#: What an empty system answers to a question about stations or networks.
NOTHING_PUBLISHED: Final = "no network is published: skyway network import bundled"

#: Cached versions of one network: the current one, and the previous while missions use it.
_KEPT_VERSIONS = 2

#: The most stations of a network that gets a hierarchy; 100,000 stations take seconds. On larger
#: networks requests are local, and search trees are as fast.
_MOST_RANKED = 200_000


@dataclass(frozen=True, slots=True)
class PreparedNetwork:
    """One version of a network, with everything that planning computes once for it.

    `straightness` is the smallest ratio of a segment's length to the great circle between its
    ends, at most 1. So no path between two stations is shorter than `straightness` times their
    great circle. `conditions` and `past_pickups` belong to the network and change without a new
    version.
    """

    network_id: NetworkId
    version: int
    network: Network
    settings: NetworkSettings
    airspace: Airspace
    hierarchy: Hierarchy | None
    straightness: float
    conditions: CachedConditions
    past_pickups: PastPickups


class PreparedNetworks:
    """The networks of this database, each parsed once; `own` says which are served here."""

    def __init__(self, db: Database, clock: FleetClock, own: OwnCells | None = None) -> None:
        self.own = own or OwnCells({}, "", "")
        self._db = db
        self._clock = clock
        self._kept: dict[NetworkId, dict[int, PreparedNetwork]] = {}
        self._loading = asyncio.Lock()

    async def current(self, network_id: NetworkId) -> PreparedNetwork:
        """The current version of a network; NotFound if there is none."""
        row = await current_row(self._db, network_id)
        return await self.version(network_id, row.version)

    async def present(self, network_id: NetworkId) -> store.Present:
        """The current version and conditions number of a network; NotFound if there is none."""
        async with self._db.read() as connection:
            present = await store.present(connection, network_id)
        if present is None:
            raise NotFound("network", network_id)
        return present

    async def around(self, station_id: StationId) -> PreparedNetwork | None:
        """The current version of the network that has this station; None when none has."""
        present = await self.present_around(station_id)
        return None if present is None else await self.version(present.network_id, present.version)

    async def present_around(self, station_id: StationId) -> store.Present | None:
        """The network that has this station, its current version and conditions number.

        Raises
        ------
        Misdirected
            Another composition serves the network.
        """
        async with self._db.read() as connection:
            present = await store.present_around(connection, station_id)
        if present is not None:
            self.own.refuse_foreign(present.network_id)
        return present

    async def why_missing(self, station_id: StationId) -> str:
        """Why no network has this station, in words."""
        async with self._db.read() as connection:
            is_empty = not await store.has_networks(connection)
        return NOTHING_PUBLISHED if is_empty else f"no network has station {station_id!r}"

    async def version(self, network_id: NetworkId, version: int) -> PreparedNetwork:
        """One version of a network; NotFound if there is none."""
        kept = self._kept.get(network_id, {}).get(version)
        if kept is not None:
            return kept
        async with self._loading:
            versions = self._kept.setdefault(network_id, {})
            if version not in versions:
                versions[version] = await self._load(network_id, version)
                for old in sorted(versions)[:-_KEPT_VERSIONS]:
                    del versions[old]
            return versions.get(version) or await self._load(network_id, version)

    async def _load(self, network_id: NetworkId, version: int) -> PreparedNetwork:
        async with self._db.read() as connection:
            content = await store.content(connection, network_id, version)
        if content is None:
            raise NotFound("network version", f"{network_id}/{version}")
        past_pickups = PastPickups(self._db, self._clock, network_id)
        return await asyncio.to_thread(_prepare, version, content, past_pickups)


def _prepare(version: int, content: bytes, past_pickups: PastPickups) -> PreparedNetwork:
    started_at, network_id = time.monotonic(), past_pickups.network_id
    network = read_network_text(content)
    # Computed on first use. Used here, so that no plan waits for them.
    adjacencies = network.outgoing, network.incoming
    settings = settings_of(network)
    prepared = PreparedNetwork(
        network_id=network_id,
        version=version,
        network=network,
        settings=settings,
        airspace=Airspace.of(network),
        hierarchy=Hierarchy.of(network) if len(network.stations) <= _MOST_RANKED else None,
        straightness=_straightness(network),
        conditions=CachedConditions(network_id, network, reserve_risk=settings.reserve_risk),
        past_pickups=past_pickups,
    )
    log.info(
        "network prepared",
        extra={
            "network_id": network_id,
            "version": version,
            "stations": len(network.row_of),
            "segments": len(adjacencies[0].segment),
            "elapsed_s": round(time.monotonic() - started_at, 2),
        },
    )
    return prepared


def _straightness(network: Network) -> float:
    columns = network.columns
    at = columns.longitude_deg, columns.latitude_deg
    ends = columns.from_row, columns.to_row
    straight_m = distances_m((at[0][ends[0]], at[0][ends[1]]), (at[1][ends[0]], at[1][ends[1]]))
    apart = straight_m > 0.0
    shares: Floats = columns.length_m[apart] / straight_m[apart]
    return float(np.min(shares, initial=1.0))


async def current_row(db: Database, network_id: NetworkId) -> VersionRow:
    """The current version of a network, without its content; NotFound if there is none."""
    async with db.read() as connection:
        current = await store.current_version(connection, network_id)
    if current is None:
        raise NotFound("network", network_id)
    return current
