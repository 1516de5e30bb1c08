"""A mission that somebody wants to change by hand, locked, with its drone's link."""

from skyway.ids import MissionId, ProviderId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict, NotFound
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Tx
from skyway_composition.missions import store
from skyway_composition.missions.record import MissionRecord
from skyway_composition.missions.watch import Watch


async def mission_under_hand(
    tx: Tx,
    mission_id: MissionId,
    *,
    provider_id: ProviderId | None,
    clock: FleetClock,
    mint: Mint,
) -> tuple[Watch, MissionRecord]:
    """The live mission, if it is this provider's (None: whoever's), and the watch over its drone.

    Raises
    ------
    NotFound
        There is no such mission of this provider.
    Conflict
        MISSION_OVER: it has ended.
    """
    # Read first without a lock, to learn the drone: links are locked before missions.
    found = await store.get(tx.connection, mission_id, provider_id=provider_id)
    if found is None:
        raise NotFound("mission", mission_id)
    watch = await Watch.over([found.drone_id], tx=tx, clock=clock, mint=mint)
    record = watch.missions.get(found.drone_id)
    if record is None or record.mission_id != mission_id:
        raise Conflict("MISSION_OVER", f"{mission_id} is over")
    return watch, record
