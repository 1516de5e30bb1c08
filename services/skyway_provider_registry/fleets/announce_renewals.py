"""Forgets the numbers of messages that came with earlier credentials, here and in composition."""

from dataclasses import dataclass
from datetime import timedelta
from typing import Final, Protocol

from skyway.contracts.drones import RENEWALS, Renewal, Renewals
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.sql.database import Database
from skyway_provider_registry import renewal_store
from skyway_provider_registry.presence import sighting_store

#: Wall time after a renewal. The broker has disconnected the earlier credentials by then (0.1 s),
#: and their last messages are read.
_SETTLED_AFTER: Final = timedelta(seconds=3)

#: The most renewals of one request.
_MOST_AT_ONCE: Final = 200


class Announce(Protocol):
    """Notifies composition of renewals."""

    async def __call__(self, renewals: Renewals) -> None:
        """Return when composition knows them."""


@dataclass(frozen=True, slots=True)
class CompositionNotice:
    """`Announce` by REST."""

    client: ServiceClient

    async def __call__(self, renewals: Renewals) -> None:
        """Post the renewals to composition.

        Raises
        ------
        ServiceUnavailable
            Composition is away; it will be notified later.
        """
        await self.client.call("POST", RENEWALS, body=renewals)


@dataclass(frozen=True, slots=True)
class RenewalAnnouncer:
    """Announces the renewals that have settled."""

    db: Database
    clock: FleetClock
    announce: Announce

    async def step(self) -> bool:
        """Step of a loop: announce the next renewals; whether there are more."""
        until_wall_at = self.clock.wall_now() - _SETTLED_AFTER
        async with self.db.read() as connection:
            due = await renewal_store.due(
                connection, until_wall_at=until_wall_at, limit=_MOST_AT_ONCE
            )
        if not due:
            return False
        renewals = tuple(Renewal(drone_id=each.drone_id, at=each.at) for each in due)
        await self.announce(Renewals(renewals=renewals))
        async with self.db.write() as tx:
            await sighting_store.forget_order(tx, [each.drone_id for each in due])
            await renewal_store.mark_announced(tx, due)
        return len(due) == _MOST_AT_ONCE
