"""Passes the alarms about drones on to composition, which shows all alarms.

Waiting messages go past the servers of composition that do not answer.
"""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Final

from skyway.cells import CellClients
from skyway.contracts.drones import DRONE_ALARMS, DroneAlarm
from skyway.ids import NetworkId
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.sql.database import Database
from skyway_provider_registry.presence import jump_store

#: The networks whose servers do not answer, each with the error.
Silent = dict[NetworkId, ServiceUnavailable]


async def send_past_silent(send: Callable[[Silent], Awaitable[int]], *, most: int) -> bool:
    """Send messages for several servers; messages for a silent server keep back no others.

    `send` looks for at most `most` messages whose network is not in the dictionary, and sends them.
    It adds each network whose server does not answer, and returns how many messages it found. The
    result is whether there may be more messages.

    Raises
    ------
    ServiceUnavailable
        A server does not answer; the messages for its networks wait.
    """
    silent: Silent = {}
    while True:
        before = len(silent)
        found = await send(silent)
        if found < most or len(silent) == before:
            break  # else there may be other messages behind those for a silent server
    for first in silent.values():
        raise first
    return found == most


#: The most alarms of one step.
_MOST_AT_ONCE: Final = 20


@dataclass(frozen=True, slots=True)
class AlarmAnnouncer:
    """Posts each waiting alarm; an alarm that is posted twice is raised once."""

    db: Database
    servers: CellClients

    async def step(self) -> bool:
        """Step of a loop: post the next alarms; whether there may be more.

        Raises
        ------
        ServiceUnavailable
            A server of composition is away; the alarms about its drones wait.
        """
        return await send_past_silent(self._announce_waiting, most=_MOST_AT_ONCE)

    async def _announce_waiting(self, silent: Silent) -> int:
        async with self.db.read() as connection:
            waiting = await jump_store.waiting(connection, limit=_MOST_AT_ONCE, without=silent)
        for alarm, network_id in waiting:
            if network_id not in silent:
                try:
                    await self._announce(alarm, network_id)
                except ServiceUnavailable as error:
                    silent[network_id] = error  # another network may have another server
        return len(waiting)

    async def _announce(self, alarm: DroneAlarm, network_id: NetworkId) -> None:
        await self.servers.of(network_id).call("POST", DRONE_ALARMS, body=alarm)
        async with self.db.write() as tx:
            await jump_store.remove_waiting(tx, alarm)
