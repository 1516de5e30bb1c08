"""Requests another plan for missions whose plan no longer holds."""

from collections.abc import Iterable
from dataclasses import replace

from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, report
from skyway_composition.missions.replanning.store import plan_now, save_troubles


async def request_plan(
    work: MissionUnitOfWork, record: MissionRecord, trouble: Trouble
) -> MissionRecord:
    """Save why a mission needs another plan; the replanner finds the mission once woken.

    The first trouble is reported, later troubles are not. The caller wakes `stuck` after the
    commit.
    """
    record = _with_trouble(work, record, trouble)
    await work.save(record)
    await plan_now(work.tx, record.mission_id)
    return record


async def request_plans(
    work: MissionUnitOfWork, records: Iterable[MissionRecord], trouble: Trouble
) -> None:
    """Request plans for many missions in one statement: a closure may hit hundreds of them."""
    changed = [_with_trouble(work, each, trouble) for each in records]
    await save_troubles(work.tx, changed)
    await work.change_calendars([each.drone_id for each in changed])
    work.missions.update({record.drone_id: record for record in changed})


def _with_trouble(
    work: MissionUnitOfWork, record: MissionRecord, trouble: Trouble
) -> MissionRecord:
    """The record with this trouble, which is reported if it is the first.

    A mission in doubt is not planned before the doubt ends, so that is not reported.
    """
    if record.trouble is None and record.stuck is None and record.mission.doubt is None:
        record = report(
            work,
            record,
            "REPLANNING",
            at=work.clock.now(),
            code=trouble.code,
            detail=trouble.detail,
        )
    return replace(record, trouble=_merged(record.trouble, trouble))


def _merged(earlier: Trouble | None, new: Trouble) -> Trouble:
    """The new trouble, with the loading or diversion that people asked for in the earlier one.

    The earlier trouble alone is not enough: it ends when the plan made for it is accepted, and
    that plan may be on its way already.
    """
    if earlier is None or new.loaded is not None or new.land_at is not None:
        return new
    if earlier.loaded is None and earlier.land_at is None:
        return new
    return new.model_copy(
        update={
            "loaded": earlier.loaded,
            "land_at": earlier.land_at,
            "overrides_failsafe": earlier.overrides_failsafe,
        }
    )
