"""Forgets the numbers of messages that came with earlier credentials, here and in composition."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Final, Protocol

from skyway.cells import CellClients
from skyway.contracts.drones import RENEWALS, Renewal, Renewals
from skyway.ids import NetworkId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.sql.database import Database
from skyway_provider_registry import change_store
from skyway_provider_registry.change_store import DueRenewal
from skyway_provider_registry.presence import sighting_store
from skyway_provider_registry.presence.announce_alarms import Silent, send_past_silent

#: Wall time after a renewal. The broker has disconnected the earlier credentials by then (0.1 s),
#: and their last messages are read.
_SETTLED_AFTER: Final = timedelta(seconds=3)

#: The most renewals of one request.
_MOST_AT_ONCE: Final = 200


class Announce(Protocol):
    """Notifies composition of renewals."""

    async def __call__(self, renewals: Renewals, network_id: NetworkId) -> None:
        """Return when composition knows the renewals of drones of this network."""


@dataclass(frozen=True, slots=True)
class CompositionNotice:
    """`Announce` by REST."""

    servers: CellClients

    async def __call__(self, renewals: Renewals, network_id: NetworkId) -> None:
        """Post the renewals to the network's server.

        Raises
        ------
        ServiceUnavailable
            Composition is away; it will be notified later.
        """
        await self.servers.of(network_id).call("POST", RENEWALS, body=renewals)


@dataclass(frozen=True, slots=True)
class RenewalAnnouncer:
    """Announces the renewals that have settled."""

    db: Database
    clock: FleetClock
    announce: Announce

    async def step(self) -> bool:
        """Step of a loop: announce the next renewals; whether there are more.

        Raises
        ------
        ServiceUnavailable
            A server of composition is away; the renewals of its drones wait.
        """
        return await send_past_silent(self._announce_due, most=_MOST_AT_ONCE)

    async def _announce_due(self, silent: Silent) -> int:
        until_wall_at = self.clock.wall_now() - _SETTLED_AFTER
        async with self.db.read() as connection:
            due = await change_store.due(
                connection, until_wall_at=until_wall_at, limit=_MOST_AT_ONCE, without=silent
            )
        by_network: dict[NetworkId, list[DueRenewal]] = defaultdict(list)
        for each in due:
            by_network[each.network_id].append(each)
        for network_id, some in by_network.items():
            try:
                await self._announce(some, network_id)
            except ServiceUnavailable as error:
                silent[network_id] = error  # another network may have another server
        return len(due)

    async def _announce(self, due: Sequence[DueRenewal], network_id: NetworkId) -> None:
        renewals = tuple(Renewal(drone_id=each.drone_id, at=each.at) for each in due)
        await self.announce(Renewals(renewals=renewals), network_id)
        async with self.db.write() as tx:
            await sighting_store.forget_order(tx, [each.drone_id for each in due])
            await change_store.mark_announced(tx, due)
