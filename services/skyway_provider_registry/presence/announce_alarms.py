"""Passes the alarms about drones on to composition, which shows all alarms."""

from dataclasses import dataclass
from typing import Final

from skyway.contracts.drones import DRONE_ALARMS
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.sql.database import Database
from skyway_provider_registry.presence import jump_store

#: The most alarms of one step.
_MOST_AT_ONCE: Final = 20


@dataclass(frozen=True, slots=True)
class AlarmAnnouncer:
    """Posts each waiting alarm; an alarm that is posted twice is raised once."""

    db: Database
    composition: ServiceClient

    async def step(self) -> bool:
        """Step of a loop: post the next alarms; whether there may be more.

        Raises
        ------
        ServiceUnavailable
            Composition is away; the alarms wait.
        """
        async with self.db.read() as connection:
            alarms = await jump_store.waiting(connection, limit=_MOST_AT_ONCE)
        for alarm in alarms:
            await self.composition.call("POST", DRONE_ALARMS, body=alarm)
            async with self.db.write() as tx:
                await jump_store.remove_waiting(tx, alarm)
        return len(alarms) == _MOST_AT_ONCE
