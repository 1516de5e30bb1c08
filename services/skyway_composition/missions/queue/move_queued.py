"""Carries out what was decided about QUEUED missions: they are sent, moved or dropped.

A standby ends early for the mission after it. A mission that moves gets new steps, pads and arrival
times in one transaction.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from datetime import timedelta
from typing import Final

from skyway.contracts.flight_step import end_of
from skyway.ids import MissionId
from skyway.runtime.sql.database import Tx
from skyway.scheduling.trip import without
from skyway.units import ms_to_moment
from skyway_composition.links.instruction_store import last_revision
from skyway_composition.margins import PROOF_ARRIVES
from skyway_composition.missions.mission.end import refuse
from skyway_composition.missions.mission.from_trip import StepTerms, finished_wait, flight_steps
from skyway_composition.missions.mission.instruct import send_mission
from skyway_composition.missions.mission.record import NEXT_MISSION, MissionRecord, Trouble, moved
from skyway_composition.missions.mission.standby import (
    shorten_queued,
    shortened_mission,
    shortened_steps,
)
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, free_from, report
from skyway_composition.missions.queue import store
from skyway_composition.missions.queue.plan_queue import Dropped, Moved
from skyway_composition.missions.replanning.propose import Revision, propose
from skyway_composition.missions.replanning.remainder.anchor import Anchor
from skyway_composition.missions.replanning.situation import Situation, whereabouts
from skyway_composition.networks.prepared import PreparedNetwork
from skyway_composition.pads.store import give_way, hold, pads_of_queued

#: The customer is notified of a new arrival time that differs by more than this. Our own choice.
_TOLERANCE: Final = timedelta(minutes=2)

_MOVED: Final = "its place in the calendars of its provider's drones has changed"
_EXCHANGED: Final = "a drone of another provider flies it, for the same price and on the same terms"


async def make_firm(work: MissionUnitOfWork, record: MissionRecord) -> MissionRecord:
    """Promise the arrival times of a QUEUED mission's present plan, if its promise is not firm."""
    if record.mission.firm_at is None:
        return record
    mission = record.mission.model_copy(update={"firm_at": None})
    firm = replace(record, mission=mission, promised=mission.packages)
    firm = report(work, firm, "PROMISED", mission=mission, free_from=free_from(firm))
    await work.save(firm)
    await store.save_promises(work.tx, firm)
    return firm


async def send_next(work: MissionUnitOfWork, record: MissionRecord) -> None:
    """Send a QUEUED mission to its drone, which has no other mission; its promise becomes firm."""
    record = await make_firm(work, record)
    await send_mission(work, replace(moved(record, "BOOKED"), planned_in=None))


async def shorten_standby(work: MissionUnitOfWork, record: MissionRecord, *, until_ms: int) -> None:
    """Propose that the drone ends its standby at this moment, where its next mission begins.

    If the drone has left that stay already, nothing is sent; its next landing is found later.
    """
    situation = await Situation.of(work, record)
    changed = shortened_steps(situation.planned, until_ms=until_ms)
    where = whereabouts(situation)
    if changed is None or where is None:
        return
    first_step, steps = changed
    is_under_way = first_step <= where.released_through
    if first_step < where.next_step or (is_under_way and not steps):
        return
    before = [each for each in situation.planned if each.step_id < first_step]
    station_id = end_of(before[-1]) if before else where.station_id
    if station_id is None:
        return
    if not steps:
        steps = (finished_wait(station_id, until_ms, step_id=first_step),)
    sent = max(record.mission.revision, await last_revision(work.tx, record.mission_id))
    mission = shortened_mission(record.mission, served_ms=record.served_ms, until_ms=until_ms)
    revision = Revision(mission.model_copy(update={"revision": sent + 1}), steps, record.aims)
    anchor = Anchor(
        station_id=station_id,
        at_ms=until_ms,
        soc=where.soc,
        last_valid_step=first_step - 1,
        carried=situation.carried,
        has_loaded=situation.has_loaded,
        is_divert=is_under_way,
    )
    detail = f"the drone's next mission begins at {ms_to_moment(until_ms).isoformat()}"
    trouble = Trouble(code=NEXT_MISSION, detail=detail)
    await propose(work, record, revision, anchor=anchor, trouble=trouble)


async def give_back_pads(tx: Tx, records: Sequence[MissionRecord]) -> None:
    """Free the pads and times of QUEUED missions, before any of them reserves others."""
    await store.free_times(tx, [each.mission_id for each in records])
    for record in records:
        await hold(tx, record.mission_id, ())


async def drop(work: MissionUnitOfWork, dropped: Dropped) -> None:
    """Give up a mission for which its drone has no plan; another drone may fly it."""
    reason = dropped.reason
    detail = f"its drone has no plan for it any more: {reason.code}, {reason.detail}"
    await refuse(work, dropped.record, Trouble(code="CALENDAR_CHANGED", detail=detail))


async def move(
    work: MissionUnitOfWork,
    planned: Moved,
    skyway: PreparedNetwork,
    *,
    earlier: MissionRecord,
    before: Collection[MissionId],
) -> None:
    """Save a mission with its new plan, and report its new arrival times.

    The drone's missions `before` it give up pads of their standby that the new plan needs. Pads
    that a later mission holds stay with that one.
    """
    record, pads = planned.record, planned.trip.booked_pads
    steps = flight_steps(
        skyway.network,
        list(planned.trip.steps()),
        terms=StepTerms.of(record, skyway.settings, proof_wait=PROOF_ARRIVES.span(work.clock)),
        first_step=1,
    )
    await work.steps.replace(record.mission_id, steps, first_step=1, revision=1)
    for mission_id in before:
        await give_way(work.tx, mission_id, pads)
    later = await pads_of_queued(work.tx.connection, record.drone_id)
    record = _report_times(work, record, earlier)
    await store.save_start(work.tx, record.mission_id, record.candidate)
    await work.save(record)
    await hold(work.tx, record.mission_id, without(pads, later))
    if planned.until_ms is not None:
        await shorten_queued(work.tx, record, planned.until_ms)


def _report_times(
    work: MissionUnitOfWork, record: MissionRecord, earlier: MissionRecord
) -> MissionRecord:
    """Report the new plan; REPLANNED notifies the customer, RETIMED does not."""
    is_exchanged = earlier.mission.provider_id != record.mission.provider_id
    before = {each.package_id: each.eta_at for each in earlier.mission.packages}
    shifts = {
        each.package_id: abs(each.eta_at - before[each.package_id])
        for each in record.mission.packages
        if each.package_id in before
    }
    return report(
        work,
        replace(record, report_seq=earlier.report_seq),
        "REPLANNED" if is_exchanged else _kind(shifts.values()),
        at=work.clock.now(),
        kinds={
            share.mission_id: _kind(shifts[each] for each in share.packages if each in shifts)
            for share in record.shares
        },
        code="PROVIDER_CHANGED" if is_exchanged else "CALENDAR_CHANGED",
        detail=_EXCHANGED if is_exchanged else _MOVED,
        etas=record.mission.packages,
        mission=record.mission,
        free_from=free_from(record),
        drone_before=earlier.drone_id if earlier.drone_id != record.drone_id else None,
    )


def _kind(shifts: Iterable[timedelta]) -> str:
    """The kind of the report about packages whose arrival times change by this much."""
    return "RETIMED" if max(shifts, default=timedelta(0)) <= _TOLERANCE else "REPLANNED"
