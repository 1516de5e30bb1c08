"""All SQL of steps that were cut, and of all that a drone has done on a mission."""

from sqlalchemy import select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.drone_report import DroneEvent
from skyway.ids import MissionId
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_composition.tables import cut_steps, mission_steps


async def keep(tx: Tx, mission_id: MissionId, event: DroneEvent) -> None:
    """Keep what a cut step took, before the step in its place does away with it."""
    if event.started_at is None:
        return
    row = {
        "mission_id": mission_id,
        "seq": event.seq,
        "step_id": event.step_id,
        "kind": event.step_kind,
        "station_id": event.station_id,
        "started_ms": moment_to_ms(event.started_at),
        "ended_ms": moment_to_ms(event.ended_at),
        "event": event.model_dump_json(),
    }
    await tx.execute(tx.insert(cut_steps).values(row).on_conflict_do_nothing())


async def ended_events(connection: AsyncConnection, mission_id: MissionId) -> list[DroneEvent]:
    """The ends of all steps of a mission, of cut ones too, in the order in which they came."""
    ended = select(mission_steps.c.event).where(
        mission_steps.c.mission_id == mission_id,
        mission_steps.c.status == "ENDED",
        mission_steps.c.event.is_not(None),
    )
    cut = select(cut_steps.c.event).where(cut_steps.c.mission_id == mission_id)
    texts = [
        *(await connection.execute(ended)).scalars(),
        *(await connection.execute(cut)).scalars(),
    ]
    # A step is among both from when it was cut until its number is another's.
    events = {event.seq: event for event in map(DroneEvent.read, texts)}
    return [events[seq] for seq in sorted(events)]
