"""Trouble: the plan of a mission does not hold any more, and another one is to be looked for."""

from dataclasses import replace

from skyway_composition.missions import store
from skyway_composition.missions.record import MissionRecord, Trouble
from skyway_composition.missions.report import report
from skyway_composition.missions.watch import Watch


async def troubled(watch: Watch, record: MissionRecord, trouble: Trouble) -> MissionRecord:
    """Keep why a mission needs another plan; the recomposer finds it once it is woken.

    Told once, however many troubles follow. Whoever calls this wakes `stuck` after the commit.
    """
    if record.trouble is not None and _outlasts(record.trouble, trouble):
        return record
    if record.trouble is None and record.stuck is None:
        record = report(
            watch.tx,
            record,
            "REPLANNING",
            at=watch.clock.now(),
            mint=watch.mint,
            code=trouble.code,
            detail=trouble.detail,
        )
    record = replace(record, trouble=trouble)
    await watch.keep(record)
    await store.plan_at_once(watch.tx, record.mission_id)
    return record


def _outlasts(known: Trouble, new: Trouble) -> bool:
    """Whether the known trouble says what must not be forgotten, and the new one does not."""
    if new.loaded is not None or new.land_at is not None:
        return False
    return known.loaded is not None or known.land_at is not None
