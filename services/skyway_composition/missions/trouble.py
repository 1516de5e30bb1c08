"""Trouble: the plan of a mission does not hold any more, and another one is to be looked for."""

from collections.abc import Iterable
from dataclasses import replace

from skyway_composition.missions import store
from skyway_composition.missions.record import MissionRecord, Trouble
from skyway_composition.missions.report import report
from skyway_composition.missions.watch import Watch


async def troubled(watch: Watch, record: MissionRecord, trouble: Trouble) -> MissionRecord:
    """Keep why a mission needs another plan; the recomposer finds it once it is woken.

    Told once, however many troubles follow. Whoever calls this wakes `stuck` after the commit.
    """
    told = _told(watch, record, trouble)
    if told is not record:
        await watch.keep(told)
        await store.plan_at_once(watch.tx, told.mission_id)
    return told


async def troubled_all(watch: Watch, records: Iterable[MissionRecord], trouble: Trouble) -> None:
    """The same for many missions, in one statement: a closure may hit hundreds of them."""
    changed = [told for each in records if (told := _told(watch, each, trouble)) is not each]
    await store.save_troubles(watch.tx, changed)
    watch.missions.update({record.drone_id: record for record in changed})


def _told(watch: Watch, record: MissionRecord, trouble: Trouble) -> MissionRecord:
    """The record with this trouble, told if it is the first; unchanged if an older one outlasts."""
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
    return replace(record, trouble=trouble)


def _outlasts(known: Trouble, new: Trouble) -> bool:
    """Whether the known trouble says what must not be forgotten, and the new one does not."""
    if new.loaded is not None or new.land_at is not None:
        return False
    return known.loaded is not None or known.land_at is not None
