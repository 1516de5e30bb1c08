"""Close and reopen: the closure, the network's conditions and its missions in one transaction.

A booking checks in its own transaction that the conditions are the ones it planned with. So once a
closure is made, no plan that breaks it can be booked (I11).
"""

from dataclasses import dataclass, replace
from itertools import compress
from typing import Protocol

from skyway.ids import ClosureId, NetworkId, StationId
from skyway.network.network import Network
from skyway.network.zones import Outline, points_of
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.closures import store
from skyway_composition.closures.closure import AffectedMission, Closure, Impact, Reach
from skyway_composition.closures.conditions import Conditions


class Tolerance(Protocol):
    """The settings of a network that closures read."""

    @property
    def tolerated_lateness_s(self) -> float:
        """How late a drone may be without a new plan, seconds."""
        ...


class PublishedNetwork(Protocol):
    """A network as it was published."""

    @property
    def network_id(self) -> NetworkId:
        """Id of the network."""
        ...

    @property
    def network(self) -> Network:
        """Stations and segments of the network."""
        ...

    @property
    def settings(self) -> Tolerance:
        """Settings of the network."""
        ...


class CurrentNetworks(Protocol):
    """The current version of every network."""

    async def current(self, network_id: NetworkId) -> PublishedNetwork:
        """The current version of a network."""
        ...

    async def around(self, station_id: StationId) -> PublishedNetwork | None:
        """The current version of the network that has this station; None for no network."""
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
        """Current fleet time, ms since 1970."""
        return moment_to_ms(self.clock.now())

    async def around(self, station_id: StationId) -> PublishedNetwork:
        """The network that has this station; NotFound if none has."""
        found = await self.networks.around(station_id)
        if found is None:
            raise NotFound("station", station_id)
        return found

    async def preview(self, closure: Closure) -> tuple[AffectedMission, ...]:
        """The missions that the closure would affect, the first ones with their delays."""
        return await self.impact.foresee(self.db, await self.reach(closure))

    async def make(self, closure: Closure) -> tuple[Closure, tuple[AffectedMission, ...]]:
        """Make a closure; return it with the missions that it affects."""
        closure = replace(closure, closure_id=ClosureId(self.mint("clo")))
        reach = await self.reach(closure)
        async with self.db.write() as tx:
            # Locked before all other rows, so that this and a booking wait for each other here.
            await store.change_conditions(tx, closure.network_id)
            await store.add(tx, closure)
            affected = await self.impact.apply(tx, reach)
        return closure, affected

    async def lift(self, closure: Closure) -> None:
        """Lift a closure; a closure that was lifted before stays lifted."""
        async with self.db.write() as tx:
            await store.change_conditions(tx, closure.network_id)
            if await store.lift(tx, closure.closure_id, now_ms=self.now_ms):
                await self.impact.retry(tx, closure.network_id)

    async def reach(self, closure: Closure) -> Reach:
        """The closure with what it closes; NotFound if there is no such network."""
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
        """The stations in a ground stop's area; None for a ground stop without an area."""
        zone = stop.zone
        if zone is None:
            return None
        outline = Outline(zone)
        async with self.db.read() as connection:
            places = await store.stations_between(
                connection, outline.box[1], outline.box[3], network_id=stop.network_id
            )
        return frozenset(compress(places, outline.holds(points_of(places.values()))))
