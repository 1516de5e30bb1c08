"""Gives up the QUEUED missions of drones that are out of service, so that other drones fly them.

The registry knows which drones are in maintenance, and which providers are suspended. A live
mission is not touched: its drone flies it, or people end it by a command.
"""

from dataclasses import dataclass

from skyway.contracts.drones import (
    MOST_DRONES,
    OUT_OF_SERVICE,
    OutOfServiceAnswer,
    OutOfServiceQuery,
)
from skyway.ids import DroneId
from skyway.runtime.http.client import ServiceClient
from skyway_composition.context import Context
from skyway_composition.missions.mission.end import refuse
from skyway_composition.missions.mission.store import queued_of_drone
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.queue import store
from skyway_composition.networks.store import share_current


@dataclass(frozen=True, slots=True)
class WithdrawnDrones:
    """Looks after the calendars of drones that were taken out of service."""

    context: Context
    registry: ServiceClient

    async def step(self) -> bool:
        """Step of a loop: ask about all drones with QUEUED missions. Always False.

        Raises
        ------
        ServiceUnavailable
            The registry is away; calendars stay as they are.
        """
        async with self.context.db.read() as connection:
            drone_ids = await store.drones_with_queue(connection)
        for first in range(0, len(drone_ids), MOST_DRONES):
            asked = OutOfServiceQuery(drone_ids=tuple(drone_ids[first : first + MOST_DRONES]))
            answer = await self.registry.call(
                "POST", OUT_OF_SERVICE, body=asked, answer=OutOfServiceAnswer
            )
            for drone_id in answer.drone_ids:
                while await self._give_up_last(drone_id):
                    pass
        return False

    async def _give_up_last(self, drone_id: DroneId) -> bool:
        """Give up the drone's last QUEUED mission; returns whether there was one."""
        async with self.context.db.read() as connection:
            seen = await queued_of_drone(connection, drone_id)
        if not seen:
            return False
        async with self.context.db.write() as tx:
            # Every transaction that changes a calendar locks the network first, then the drone.
            await share_current(tx, seen[-1].network_id)
            work = await MissionUnitOfWork.lock(self.context, tx, [drone_id])
            queued = await queued_of_drone(tx.connection, drone_id)
            if queued:
                detail = "its drone is out of service"
                await refuse(work, queued[-1], code="DRONE_NOT_FREE", detail=detail)
        return True
