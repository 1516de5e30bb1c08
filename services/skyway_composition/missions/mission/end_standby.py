"""Makes room in a drone's calendar for a mission that begins before a standby would end."""

from skyway.ids import MissionId
from skyway.runtime.sql.database import Tx
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.release_pads import pads_of
from skyway_composition.missions.mission.shorten import shortened_mission, shortened_steps
from skyway_composition.missions.mission.step_store import replace_steps, steps_of
from skyway_composition.pads.store import hold


async def end_standby_before(tx: Tx, mission_id: MissionId, until_ms: int) -> None:
    """End the standby of a QUEUED mission early; its drone's link is locked.

    The standby of a mission that was sent ends when its drone has accepted that.
    """
    record = await store.get(tx.connection, mission_id, provider_id=None)
    if record is not None and record.mission.state == "QUEUED":
        await shorten_queued(tx, record, until_ms)


async def shorten_queued(tx: Tx, record: MissionRecord, until_ms: int) -> None:
    """Leave out what a QUEUED mission would do after this moment, and free those pads."""
    steps = [each.step for each in await steps_of(tx.connection, record.mission_id)]
    changed = shortened_steps(steps, until_ms=until_ms)
    if changed is None:
        return
    first_step, replacement = changed
    await replace_steps(tx, record.mission_id, replacement, first_step=first_step, revision=1)
    kept = (*(each for each in steps if each.step_id < first_step), *replacement)
    pad_gap_s = record.mission.margins.pad_gap_s
    await hold(tx, record.mission_id, pads_of(kept, pad_gap_s=pad_gap_s))
    mission = shortened_mission(record.mission, served_ms=record.served_ms, until_ms=until_ms)
    await store.save_all(tx, [record.with_mission(mission)])
