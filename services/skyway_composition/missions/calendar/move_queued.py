"""Applies new plans of QUEUED missions: steps, pads and arrival times change in one transaction."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from datetime import timedelta
from typing import Final

from skyway.ids import MissionId
from skyway.runtime.sql.database import Tx
from skyway.scheduling.booked_pad import without
from skyway_composition.missions.calendar import store
from skyway_composition.missions.calendar.plan_queue import Dropped, Moved
from skyway_composition.missions.mission.end import refuse
from skyway_composition.missions.mission.from_trip import StepTerms, flight_steps
from skyway_composition.missions.mission.notify import free_from, report
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.standby import shorten_queued
from skyway_composition.missions.mission.step_store import replace_steps
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.networks.prepared import PreparedNetwork
from skyway_composition.pads.store import give_way, hold, pads_of_queued

#: The customer is notified of a new arrival time that differs by more than this. Our own choice.
_TOLERANCE: Final = timedelta(minutes=2)


async def give_back_pads(tx: Tx, records: Sequence[MissionRecord]) -> None:
    """Free the pads and times of QUEUED missions, before any of them reserves others."""
    await store.free_times(tx, [each.mission_id for each in records])
    for record in records:
        await hold(tx, record.mission_id, ())


async def drop(work: MissionUnitOfWork, dropped: Dropped) -> None:
    """Give up a mission for which its drone has no plan; another drone may fly it."""
    reason = dropped.reason
    detail = f"its drone has no plan for it any more: {reason.code}, {reason.detail}"
    await refuse(work, dropped.record, code="CALENDAR_CHANGED", detail=detail)


async def move(
    work: MissionUnitOfWork,
    moved: Moved,
    skyway: PreparedNetwork,
    *,
    earlier: MissionRecord,
    before: Collection[MissionId],
) -> None:
    """Save a mission with its new plan, and report its new arrival times.

    The drone's missions `before` it give up pads of their standby that the new plan needs. Pads
    that a later mission holds stay with that one.
    """
    record, pads = moved.record, moved.trip.booked_pads
    steps = flight_steps(
        skyway.network,
        list(moved.trip.steps()),
        terms=StepTerms.of(record, skyway.settings),
        first_step=1,
    )
    await replace_steps(work.tx, record.mission_id, steps, first_step=1, revision=1)
    for mission_id in before:
        await give_way(work.tx, mission_id, pads)
    later = await pads_of_queued(work.tx.connection, record.drone_id)
    record = _report_times(work, record, earlier)
    await store.save_start(work.tx, record)
    await work.save(record)
    await hold(work.tx, record.mission_id, without(pads, later))
    if moved.until_ms is not None:
        await shorten_queued(work.tx, record, moved.until_ms)


def _report_times(
    work: MissionUnitOfWork, record: MissionRecord, earlier: MissionRecord
) -> MissionRecord:
    """Report the new plan; REPLANNED notifies the customer, RETIMED does not."""
    before = {each.package_id: each.eta_at for each in earlier.mission.packages}
    shifts = [abs(each.eta_at - before[each.package_id]) for each in record.mission.packages]
    is_small = max(shifts, default=timedelta(0)) <= _TOLERANCE
    return report(
        work,
        replace(record, report_seq=earlier.report_seq),
        "RETIMED" if is_small else "REPLANNED",
        at=work.clock.now(),
        code="CALENDAR_CHANGED",
        detail="the missions before it in its drone's calendar have changed",
        etas=record.mission.packages,
        mission=record.mission,
        free_from=free_from(record),
    )
