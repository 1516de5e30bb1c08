"""Calls a mission off: it ends once its drone has confirmed that it will not fly the mission.

A clock does not know when a drone reads a CANCEL. The broker or the link may hold it back until the
drone has loaded. So the mission keeps its drone, its pads and its packages until the drone answers.
Only a drone that surely loads nothing before its next instruction leaves its packages immediately.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

from skyway.contracts.drone_report import Ack
from skyway.contracts.flight_step import PickUpStep
from skyway.ids import PackageId
from skyway.runtime.clock import FleetClock
from skyway.units import moment_to_ms
from skyway_composition.links.instruction_store import last_cancel
from skyway_composition.links.link import DroneLink
from skyway_composition.margins import PLANNED_AND_REACHES_SURELY, REACHES_SURELY
from skyway_composition.missions.mission.custody_store import has_never_left
from skyway_composition.missions.mission.end import end_cancelled
from skyway_composition.missions.mission.instruct import call_off
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.step_store import StepRecord
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, report
from skyway_composition.missions.replanning.store import plan_now, retry_stuck


async def request_call_off(work: MissionUnitOfWork, record: MissionRecord, why: Trouble) -> None:
    """Instruct the drone to cancel a mission that has a trouble, and wait for its answer.

    Planning waits too, at most until the instruction expires.
    """
    await call_off(work, record, reason=f"{why.code}: {why.detail}")
    answered_by = work.clock.wall_now() + work.courier.lifetime / work.clock.rate
    await retry_stuck(work.tx, record.mission_id, at_wall_ms=moment_to_ms(answered_by))


async def handle_answer_to_cancel(work: MissionUnitOfWork, record: MissionRecord, ack: Ack) -> None:
    """End a live mission that its drone has cancelled; plan for it if the drone refused.

    A drone that has lost its journal accepts the CANCEL of an unknown mission, and the answer of a
    drone with impossible reports proves nothing.
    """
    doubt = record.mission.doubt
    if doubt is not None and doubt.code in ("JOURNAL_LOST", "IMPLAUSIBLE"):
        return
    if ack.status == "REJECTED":
        await plan_now(work.tx, record.mission_id)
        return
    sent = await last_cancel(work.tx, work.links[record.drone_id], record.mission_id)
    reason = "CANCELLED: the drone has cancelled the mission" if sent is None else sent.reason
    code, _, detail = reason.partition(": ")
    why = Trouble(code=code, detail=detail)
    cancelled = {aim.package_id for aim in record.aims if aim.kind == "RETURN"}
    record = await _release(work, record, cancelled, why)
    await end_cancelled(work, record, why)


async def release_left_out(work: MissionUnitOfWork, record: MissionRecord) -> MissionRecord:
    """Release cancelled packages that the drone no longer loads by its new plan."""
    asked = set(record.left_out)
    if not asked:
        return record
    steps = await work.steps.of(record.mission_id)
    to_load = {
        package.package_id
        for each in steps
        if each.status == "PLANNED" and isinstance(each.step, PickUpStep)
        for package in each.step.packages
    }
    detail = "the drone has a new plan that leaves them at the pickup"
    why = Trouble(code="CANCELLED", detail=detail)
    return await _release(work, record, asked - to_load, why)


async def _release(
    work: MissionUnitOfWork, record: MissionRecord, package_ids: Collection[PackageId], why: Trouble
) -> MissionRecord:
    """Report these packages released, except those that have left the pickup."""
    held = await work.custody.held_on(record)
    staying = tuple(each for each in sorted(package_ids) if has_never_left(held.get(each)))
    if not staying:
        return record
    aims = tuple(aim for aim in record.aims if aim.package_id not in staying)
    return report(
        work,
        replace(record, aims=aims),
        "RELEASED",
        at=work.clock.now(),
        package_ids=staying,
        code=why.code,
        detail=why.detail,
    )


def surely_stays_at_pickup(record: MissionRecord, *, link: DroneLink) -> bool:
    """Whether the drone loads nothing before it gets another instruction.

    A PICK_UP that waits for a loader does not end until the loader has confirmed. A drone that
    waits for a revision starts nothing. A drone with events that were not read here may have
    loaded already.
    """
    if _may_be_loaded(record, link):
        return False
    waits_for_revision = record.stuck is not None and record.proposal is None
    return record.mission.loading == "AWAITED" or waits_for_revision


def can_stay_at_pickup(
    record: MissionRecord,
    steps: Sequence[StepRecord],
    clock: FleetClock,
    *,
    link: DroneLink,
    needs_plan: bool,
) -> bool:
    """Whether an instruction can be expected to reach the drone before it loads the packages.

    This is no proof: see `surely_stays_at_pickup`. An automatic PICK_UP that has begun cannot be
    stopped. A drone out of reach loads when its time comes, and learns of the cancellation
    afterwards.
    """
    if surely_stays_at_pickup(record, link=link):
        return True
    if _may_be_loaded(record, link) or link.is_gone:
        return False
    margin = PLANNED_AND_REACHES_SURELY if needs_plan else REACHES_SURELY
    reached_at = clock.now() + margin.span(clock)
    return all(
        each.step.planned_start_at > reached_at
        for each in steps
        if isinstance(each.step, PickUpStep) and each.status == "PLANNED"
    )


def _may_be_loaded(record: MissionRecord, link: DroneLink) -> bool:
    is_in_doubt = record.mission.doubt is not None
    return record.is_being_loaded or is_in_doubt or link.has_unread_events
