"""Ground stops: drones are held before their next take-off, and go on when all stops are over."""

from collections.abc import Sequence

from skyway.ids import ClosureId
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Tx
from skyway.runtime.minting import Mint
from skyway_composition.closures.closure import Closure
from skyway_composition.missions.affected import store
from skyway_composition.missions.affected.find import Found
from skyway_composition.missions.hold import held, hold, resume
from skyway_composition.missions.record import Trouble
from skyway_composition.missions.trouble import troubled
from skyway_composition.missions.watch import Watch


async def hold_all(watch: Watch, stop: Closure, found: Found, *, reason: str) -> None:
    """Hold the missions that were found; those that an operator holds stay the operator's."""
    stopped = await store.stopped_among(watch.tx, found.drone_ids)
    ours = []
    for hit in found.hits:
        record = watch.missions.get(hit.owner.drone_id)
        if record is None or record.mission_id != hit.owner.mission_id:
            continue
        if not record.mission.is_held:
            record = held(record, is_held=True)
            await watch.keep(record)
            await hold(watch, record, reason=reason)
        elif record.mission_id not in stopped:
            continue
        ours.append(record.mission_id)
    await store.add_stopped(watch.tx, stop.closure_id, ours)


async def let_go(
    tx: Tx, closure_ids: Sequence[ClosureId], *, clock: FleetClock, mint: Mint
) -> None:
    """Forget these stops, which are over; whom no other one holds goes on, by a new plan."""
    drones = await store.stopped_by(tx.connection, closure_ids)
    watch = await Watch.over(list(drones.values()), tx=tx, clock=clock, mint=mint)
    await store.forget_stopped(tx, closure_ids)
    still_stopped = await store.stopped_among(tx, list(drones.values()))
    for mission_id, drone_id in sorted(drones.items()):
        record = watch.missions.get(drone_id)
        if record is None or record.mission_id != mission_id:
            continue
        if mission_id in still_stopped or not record.mission.is_held:
            continue
        record = held(record, is_held=False)
        await watch.keep(record)
        await resume(watch, record)
        trouble = Trouble(code="HELD_UP", detail="the ground stop is over")
        await troubled(watch, record, trouble)
