"""Whether a provider may have more drones, and how many."""

from dataclasses import dataclass

from sqlalchemy import func, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.drones import DroneQuota
from skyway.ids import ProviderId
from skyway.runtime.errors import Conflict
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.database import Database
from skyway_provider_registry.tables import drones, providers


@dataclass(frozen=True, slots=True)
class DroneLimit:
    """Refuses drones beyond the limit of their provider."""

    db: Database
    most: int

    async def must_allow(
        self, connection: AsyncConnection, provider_id: ProviderId, caller: Caller, *, new: int
    ) -> None:
        """Go on only if the provider may have so many new drones; operators help suspended ones.

        Raises
        ------
        Conflict
            PROVIDER_SUSPENDED, or TOO_MANY_DRONES.
        """
        state = select(providers.c.state).where(providers.c.provider_id == provider_id)
        if caller.role == "provider" and await connection.scalar(state) == "SUSPENDED":
            detail = "a suspended provider registers no drones: ask an operator"
            raise Conflict("PROVIDER_SUSPENDED", detail)
        used = await _used(connection, provider_id)
        if used + new > self.most:
            detail = f"the limit is {self.most} drones of a provider; it has {used}"
            raise Conflict("TOO_MANY_DRONES", detail)

    async def quota(self, provider_id: ProviderId) -> DroneQuota:
        """How many drones the provider may have, and has."""
        async with self.db.read() as connection:
            return DroneQuota(most=self.most, used=await _used(connection, provider_id))


async def _used(connection: AsyncConnection, provider_id: ProviderId) -> int:
    statement = select(func.count()).where(drones.c.provider_id == provider_id)
    return int((await connection.execute(statement)).scalar_one())
