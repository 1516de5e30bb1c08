"""Reads all that a new plan of a drone's live mission begins with, in one transaction."""

from collections.abc import Sequence

from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database
from skyway_composition.links.instruction_store import last_revision
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.store import queued_of_drone
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.outlook.situation import Situation


async def read_situation(
    db: Database, drone_id: DroneId, *, clock: FleetClock, mint: Mint
) -> tuple[Situation, int, Sequence[MissionRecord]] | None:
    """The situation of its mission, the last revision that was sent, and its queue.

    None when the drone has no live mission.
    """
    async with db.write() as tx:
        work = await MissionUnitOfWork.lock([drone_id], tx=tx, clock=clock, mint=mint)
        record = work.missions.get(drone_id)
        if record is None:
            return None
        sent = max(record.mission.revision, await last_revision(tx, record.mission_id))
        queued = await queued_of_drone(tx.connection, drone_id)
        return await Situation.of(work, record), sent, queued
