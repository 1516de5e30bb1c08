"""Trouble: the plan of a mission does not hold any more, and another one is to be looked for."""

from collections.abc import Iterable
from dataclasses import replace

from skyway_composition.missions.mission.notify import report
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.store import plan_now, save_troubles


async def request_plan(
    work: MissionUnitOfWork, record: MissionRecord, trouble: Trouble
) -> MissionRecord:
    """Keep why a mission needs another plan; the recomposer finds it once it is woken.

    Told once, however many troubles follow. Whoever calls this wakes `stuck` after the commit.
    """
    record = _told(work, record, trouble)
    await work.save(record)
    await plan_now(work.tx, record.mission_id)
    return record


async def request_plans(
    work: MissionUnitOfWork, records: Iterable[MissionRecord], trouble: Trouble
) -> None:
    """The same for many missions, in one statement: a closure may hit hundreds of them."""
    told = [_told(work, each, trouble) for each in records]
    await save_troubles(work.tx, told)
    work.missions.update({record.drone_id: record for record in told})


def _told(work: MissionUnitOfWork, record: MissionRecord, trouble: Trouble) -> MissionRecord:
    """The record with this trouble, told if it is the first."""
    if record.trouble is None and record.stuck is None:
        record = report(
            work,
            record,
            "REPLANNING",
            at=work.clock.now(),
            code=trouble.code,
            detail=trouble.detail,
        )
    return replace(record, trouble=_on_top_of(record.trouble, trouble))


def _on_top_of(known: Trouble | None, new: Trouble) -> Trouble:
    """The new trouble, with what must not be forgotten of the known one: what people said.

    The known one would not do: it is over with the plan for it, which may be on its way.
    """
    if known is None or new.loaded is not None or new.land_at is not None:
        return new
    if known.loaded is None and known.land_at is None:
        return new
    return new.model_copy(
        update={
            "loaded": known.loaded,
            "land_at": known.land_at,
            "overrides_failsafe": known.overrides_failsafe,
        }
    )
