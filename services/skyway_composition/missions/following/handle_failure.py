"""Handles failures after which a drone stands and waits for another plan.

A step has failed, or the drone has refused a revision or lost its journal. After a restart during a
hand-over the drone cannot say whether the hand-over was done. A package that may have been
delivered is not delivered again: it goes back to the pickup, and people must check where it is. A
package that may have been loaded counts as not loaded, unless the drone reports it on board.
"""

import logging
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.drone_report import DroneEvent, DroneState, Fault
from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PickUpStep,
    RechargeStep,
    ReturnStep,
)
from skyway.ids import PackageId
from skyway.units import moment_to_ms
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.following.advance import (
    begin,
    handed_over,
    record_hand_over,
    record_loading,
)
from skyway_composition.missions.mission.end import end_after_forced_landing, put_in_doubt
from skyway_composition.missions.mission.instruct import send_mission
from skyway_composition.missions.mission.record import MissionRecord, OccupiedPad, Stuck, Trouble
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, raise_alarm, report
from skyway_composition.missions.replanning.propose import drop_proposal, with_aims
from skyway_composition.missions.replanning.remainder.planner import (
    absent_aim,
    back_to_pickup,
    with_changed_aims,
)
from skyway_composition.missions.replanning.store import plan_now

log = logging.getLogger(__name__)

#: Time for which no drone is sent to an occupied pad. Our own choice.
_PAD_CLOSED_FOR: Final = timedelta(minutes=15)

#: The code of a STEP_FAILED whose hand-over may or may not have happened.
_UNKNOWN = "UNKNOWN"


async def handle_step_failure(
    work: MissionUnitOfWork, record: MissionRecord, event: DroneEvent
) -> None:
    """A step has failed: the drone waits for another plan where it stands.

    A failsafe may have led it to another station. Without a station it has landed in the open, and
    its mission ends. Packages without a recipient get another aim.
    """
    step = await work.steps.planned(record.mission_id, event)
    if step is not None:
        await work.steps.end(record.mission_id, event, status="FAILED")
    record = begin(work, record, at=event.started_at or event.ended_at)
    if (done := handed_over(step, event)) is not None:
        record = await record_hand_over(work, record, done, event)
        step = _without(step, done)
    code, detail = event.code or "STEP_FAILED", _in_words(event, step)
    if event.station_id is None:
        why = Trouble(code=code, detail=detail)
        at, position = event.ended_at, event.position
        await end_after_forced_landing(work, record, why, at=at, position=position, soc=event.soc)
        return
    if code == "RECIPIENT_ABSENT":
        record = _without_recipient(work, record, step, detail=detail)
    elif code == _UNKNOWN:
        record, detail = await _handle_unknown_hand_over(work, record, step, event)
    stuck = Stuck(
        code=code,
        detail=detail,
        station_id=event.station_id,
        soc=event.soc,
        last_step=event.step_id or 0,
        occupied=_occupied_pad(step, event) if code == Fault.PAD_OCCUPIED else None,
    )
    await _keep_stuck(work, record, stuck)


def _without(step: FlightStep | None, done: DeliverStep) -> FlightStep | None:
    """The part of a DELIVER that was not done."""
    if not isinstance(step, DeliverStep):
        return step
    left = tuple(each for each in step.package_ids if each not in done.package_ids)
    return step.model_copy(update={"package_ids": left})


def _occupied_pad(step: FlightStep | None, event: DroneEvent) -> OccupiedPad | None:
    """The pad of a RECHARGE that failed because the pad was occupied."""
    if not isinstance(step, RechargeStep):
        return None
    until_ms = moment_to_ms(event.ended_at + _PAD_CLOSED_FOR)
    return OccupiedPad(station_id=step.station_id, pad=step.pad, until_ms=until_ms)


async def wait_for_revision(work: MissionUnitOfWork, record: MissionRecord, why: Trouble) -> None:
    """Note that the drone stands and waits where its last state says; replanning finds it."""
    state = work.links[record.drone_id].state
    if state is not None and state.activity == "DOWN":
        at, position = state.at, state.position
        await end_after_forced_landing(work, record, why, at=at, position=position, soc=state.soc)
        return
    if state is None or state.station_id is None:
        # The drone's place is unknown: its next state or the end of its plan decides.
        extra = {"mission_id": record.mission_id, "code": why.code}
        log.warning("stuck drone without a station", extra=extra)
        return
    last_step = 0
    if state.mission_id == record.mission_id:
        last_step = max(state.released_through or 0, state.step_id or 0)
    stuck = Stuck(
        code=why.code,
        detail=why.detail,
        station_id=state.station_id,
        soc=state.soc,
        last_step=last_step,
    )
    await _keep_stuck(work, record, stuck)


async def open_stream(work: MissionUnitOfWork, link: DroneLink, state: DroneState) -> None:
    """Start a new stream of instructions; unanswered ones of the old stream are sent again."""
    log.warning(
        "new stream", extra={"drone_id": link.drone_id, "stream": link.in_new_stream(state).stream}
    )
    await work.courier.withdraw_open(work.tx, link)
    work.stage_link(link.in_new_stream(state))
    record = work.missions.get(link.drone_id)
    if record is None:
        return
    if await _may_have_passed_packages(work, record, until_at=state.at):
        await doubt_lost_journal(work, record, state)
    elif record.mission.state == "BOOKED":
        await send_mission(work, record)
    else:
        if record.proposal is not None:
            record = await drop_proposal(work, record)
        detail = "the drone has lost its journal and with it the mission"
        await wait_for_revision(work, record, Trouble(code="JOURNAL_LOST", detail=detail))


async def doubt_lost_journal(
    work: MissionUnitOfWork, record: MissionRecord, state: DroneState
) -> MissionRecord:
    """The mission of a drone that has lost its journal: in doubt if packages may have passed.

    The unanswered instructions are withdrawn: the drone would fly the mission a second time.
    """
    if not await _may_have_passed_packages(work, record, until_at=state.at):
        return record
    await work.courier.withdraw_open(work.tx, work.links[record.drone_id])
    if record.proposal is not None:
        record = await drop_proposal(work, record)
    detail = "the drone has lost its journal, and may have loaded or handed over packages before"
    return await put_in_doubt(work, record, code="JOURNAL_LOST", detail=detail)


async def _may_have_passed_packages(
    work: MissionUnitOfWork, record: MissionRecord, *, until_at: datetime
) -> bool:
    """Whether the drone may have loaded or handed over packages without our knowledge.

    A drone does such a step at its planned time at the earliest. A drone that waits for a revision
    or for its loader does none.
    """
    waits = record.stuck is not None and record.proposal is None
    if waits or (record.mission.loading == "AWAITED" and not record.is_being_loaded):
        return False
    return any(
        each.status == "PLANNED"
        and isinstance(each.step, PickUpStep | DeliverStep | ReturnStep)
        and each.step.planned_start_at <= until_at
        for each in await work.steps.of(record.mission_id)
    )


async def _keep_stuck(work: MissionUnitOfWork, record: MissionRecord, stuck: Stuck) -> None:
    """Save why the drone waits, and report REPLANNING unless that was reported before."""
    if record.stuck is None and record.trouble is None:
        record = report(
            work,
            record,
            "REPLANNING",
            code=stuck.code,
            detail=stuck.detail,
            station_id=stuck.station_id,
        )
    await work.save(replace(record, stuck=stuck))
    await plan_now(work.tx, record.mission_id)


def _in_words(event: DroneEvent, step: FlightStep | None) -> str:
    """Why the step failed, and where the drone is if not at the end of the step."""
    match step:
        case DeliverStep() if event.code == "RECIPIENT_ABSENT" and event.detail is None:
            packages = ", ".join(step.package_ids)
            wait_s = step.recipient_wait_s
            return f"no recipient took {packages} at {step.station_id!r} within {wait_s:g} s"
        case FlyStep() if event.station_id not in (None, step.from_id, step.to_id):
            where = f"landed at {event.station_id!r} instead of {step.to_id!r}"
            return f"the drone {where}: {event.detail or event.code}"
        case FlyStep() if event.station_id == step.from_id and event.energy_j > 0:
            where = f"went back to {event.station_id!r} on its way to {step.to_id!r}"
            return f"the drone {where}: {event.detail or event.code}"
        case _:
            return event.detail or "a step failed"


def _without_recipient(
    work: MissionUnitOfWork, record: MissionRecord, step: FlightStep | None, *, detail: str
) -> MissionRecord:
    """The record with other aims for the packages that could not be handed over."""
    if not isinstance(step, DeliverStep):
        return record
    changed = [
        absent_aim(record, package) for package in record.packages(frozenset(step.package_ids))
    ]
    why = Trouble(code="RECIPIENT_ABSENT", detail=detail)
    return with_aims(work, record, with_changed_aims(record.aims, changed), why)


async def _handle_unknown_hand_over(
    work: MissionUnitOfWork, record: MissionRecord, step: FlightStep | None, event: DroneEvent
) -> tuple[MissionRecord, str]:
    """The record with new aims of the packages, and a description of what happened."""
    match step:
        case DeliverStep():
            detail = f"it is unknown whether {_named(step.package_ids)} were handed over"
            detail = f"{detail} at {step.station_id!r}"
            packages = record.packages(frozenset(step.package_ids))
            back = [back_to_pickup(record, each) for each in packages]
            aims, why = with_changed_aims(record.aims, back), Trouble(code=_UNKNOWN, detail=detail)
            record = with_aims(work, record, aims, why)
        case ReturnStep():
            detail = f"it is unknown whether {_named(step.package_ids)} were handed back"
            detail = f"{detail} at {step.station_id!r}"
        case PickUpStep():
            package_ids = tuple(each.package_id for each in step.packages)
            detail = f"it is unknown whether {_named(package_ids)} were loaded"
            detail = f"{detail} at {step.station_id!r}"
            if event.package_ids:
                record = await record_loading(work, record, step, event)
        case _:
            return record, event.detail or "it is unknown whether a step was done"
    await raise_alarm(
        work,
        record,
        level="URGENT",
        code="HAND_OVER_UNKNOWN",
        detail=f"{detail}: the drone was restarted meanwhile; people must check",
        station_id=step.station_id,
        data={"step_id": step.step_id, "step_kind": step.kind},
    )
    return record, f"{detail}: the drone was restarted meanwhile"


def _named(package_ids: tuple[PackageId, ...]) -> str:
    return ", ".join(package_ids)
