"""Closing and reopening: the row, the network's conditions and its missions in one transaction.

Whoever books asks in its own transaction whether the conditions still are those that it planned
with, so from the moment a closure is answered nothing is booked through it (I11).
"""

from dataclasses import dataclass, replace
from typing import Protocol

from skyway.ids import ClosureId, NetworkId, StationId
from skyway.network.network import Network
from skyway.network.zones import contains
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.closures import store
from skyway_composition.closures.closure import Closure
from skyway_composition.closures.conditions import Conditions
from skyway_composition.closures.impact import AffectedMission, Impact, Reach


class Tolerance(Protocol):
    """The settings of a network, as far as closures read them."""

    @property
    def tolerated_lateness_s(self) -> float:
        """How late a drone may be without another plan."""
        ...


class PublishedNetwork(Protocol):
    """A network as it was published."""

    @property
    def network_id(self) -> NetworkId:
        """Its id."""
        ...

    @property
    def network(self) -> Network:
        """Its stations and segments."""
        ...

    @property
    def settings(self) -> Tolerance:
        """Its settings."""
        ...


class CurrentNetworks(Protocol):
    """The current version of every network."""

    async def current(self, network_id: NetworkId) -> PublishedNetwork:
        """The current version of a network."""
        ...

    async def around(self, station_id: StationId) -> PublishedNetwork | None:
        """The current version of the network that has this station; None when none has."""
        ...


@dataclass(frozen=True, slots=True)
class Closings:
    """Makes and lifts closures."""

    db: Database
    networks: CurrentNetworks
    impact: Impact
    clock: FleetClock
    mint: Mint

    @property
    def now_ms(self) -> int:
        """The present moment of fleet time."""
        return moment_to_ms(self.clock.now())

    async def around(self, station_id: StationId) -> PublishedNetwork:
        """The network that has this station.

        Raises
        ------
        NotFound
            None has.
        """
        found = await self.networks.around(station_id)
        if found is None:
            raise NotFound("station", station_id)
        return found

    async def preview(self, closure: Closure) -> tuple[AffectedMission, ...]:
        """The missions that this would hit."""
        return await self.impact.preview(self.db, await self.reach(closure))

    async def make(self, closure: Closure) -> tuple[Closure, tuple[AffectedMission, ...]]:
        """Close it, and the missions that this hits."""
        closure = replace(closure, closure_id=ClosureId(self.mint("clo")))
        reach = await self.reach(closure)
        async with self.db.write() as tx:
            # First of all rows: whoever books in this network waits here, or is waited for.
            await store.change_conditions(tx, closure.network_id)
            await store.add(tx, closure)
            affected = await self.impact.strike(tx, reach)
        return closure, affected

    async def lift(self, closure: Closure) -> None:
        """Reopen what was closed; what is open already stays so."""
        reach = await self.reach(closure)
        async with self.db.write() as tx:
            await store.change_conditions(tx, closure.network_id)
            if await store.lift(tx, closure.closure_id, now_ms=self.now_ms):
                await self.impact.relieve(tx, reach)

    async def reach(self, closure: Closure) -> Reach:
        """The closure with what of the world it reaches.

        Raises
        ------
        NotFound
            There is no such network.
        """
        if closure.kind == "GROUND_STOP":
            if closure.network_id is not None:
                await self.networks.current(closure.network_id)
            return Reach(closure, await self._under(closure))
        if closure.network_id is None or closure.kind == "PAD":
            return Reach(closure)
        skyway = await self.networks.current(closure.network_id)
        stations, segments = Conditions(skyway.network, (closure,)).reach(closure)
        late_ms = round(skyway.settings.tolerated_lateness_s * 1000)
        return Reach(closure, frozenset(stations), frozenset(segments), late_ms)

    async def _under(self, stop: Closure) -> frozenset[StationId] | None:
        """The stations in a ground stop's area; None when it has none."""
        zone = stop.zone
        if zone is None:
            return None
        async with self.db.read() as connection:
            near = await store.stations_in(connection, zone.box, network_id=stop.network_id)
        return frozenset(name for name, position in near.items() if contains(zone, position))
