"""Stops packages of a mission: they stay at the pickup, or are brought back there."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Final

from skyway.contracts.flight_step import PackageOnBoard
from skyway.contracts.mission import Cancellation
from skyway.delivery.request import Package
from skyway.ids import PackageId
from skyway_composition.missions.mission import end as ending
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.custody_store import (
    Custodian,
    has_never_left,
)
from skyway_composition.missions.mission.record import Aim, MissionRecord, Trouble
from skyway_composition.missions.mission.share import ready_at
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, report
from skyway_composition.missions.replanning.call_off import (
    can_stay_at_pickup,
    request_call_off,
    surely_stays_at_pickup,
)
from skyway_composition.missions.replanning.check_plan import request_plan
from skyway_composition.missions.replanning.propose import with_aims
from skyway_composition.missions.replanning.remainder.planner import with_changed_aims

#: The trouble code of a mission that needs another plan because it carries fewer packages.
PACKAGES_CANCELLED: Final = "PACKAGES_CANCELLED"


async def stop_packages(
    work: MissionUnitOfWork, record: MissionRecord, package_ids: Collection[PackageId], why: Trouble
) -> Cancellation:
    """Cancel these packages of a live mission, as far as possible.

    Packages at the pickup are released immediately only if the drone surely does not load them. The
    others count as returning until the drone has answered: then it leaves them, or brings them
    back. A drone that loads soon and has not accepted the mission yet cannot be instructed in time:
    its packages are too late to cancel.
    """
    held = await work.custody.held_on(record)
    own = [each.package_id for each in record.packages(frozenset(package_ids))]
    drone = Custodian("DRONE", record.drone_id)
    carried = [each for each in own if each in held and held[each].custodian == drone]
    waiting = [each for each in own if has_never_left(held.get(each))]
    too_late = [each for each in own if each not in carried and each not in waiting]

    steps = await work.steps.of(record.mission_id)
    carries_others = len(waiting) < len(record.request.packages)
    link = work.links[record.drone_id]
    if waiting and not can_stay_at_pickup(
        record, steps, work.clock, link=link, needs_plan=carries_others
    ):
        if record.mission.state == "BOOKED":
            too_late += waiting
        else:
            carried += waiting
        waiting = []
    if carried:
        record = await return_packages(work, record, carried, why)
    returning = [*carried, *(each for each in record.left_out if each in package_ids)]
    if waiting and not surely_stays_at_pickup(record, link=link):
        await _ask_to_leave(work, record, waiting, why)
        returning, waiting = [*returning, *waiting], []
    if waiting:
        await _release(work, record, waiting, why)
    return Cancellation(
        released=tuple(waiting), returning=tuple(returning), too_late=tuple(too_late)
    )


async def release_queued(
    work: MissionUnitOfWork, record: MissionRecord, package_ids: Collection[PackageId], why: Trouble
) -> tuple[PackageId, ...]:
    """Leave these packages of a QUEUED mission at the pickup; returns the packages that it had.

    Its drone was never instructed, so this is safe. With other packages left the mission is
    refused, so that the gateway books a plan for these. A mission that is shared goes on without
    these packages, and is planned again: the promises to the other customers stay.
    """
    own = tuple(each.package_id for each in record.packages(frozenset(package_ids)))
    if not own:
        return ()
    record = report(work, record, "RELEASED", package_ids=own, code=why.code, detail=why.detail)
    left = len(record.request.packages) - len(own)
    if left and record.shares:
        await work.save(await _left_out_of(work, record, own))
        await work.plan_queue_again(record.drone_id)
    elif left:
        detail = f"planned again for the other {left} packages: {why.detail}"
        await ending.refuse(work, record, Trouble(code=why.code, detail=detail))
    else:
        await ending.cancel_queued(work, record, why)
    return own


async def return_packages(
    work: MissionUnitOfWork, record: MissionRecord, package_ids: Collection[PackageId], why: Trouble
) -> MissionRecord:
    """Have the drone return these packages to the pickup instead of delivering them."""
    record = _turned_back(work, record, package_ids, why)
    return await request_plan(work, record, why)


def _turned_back(
    work: MissionUnitOfWork, record: MissionRecord, package_ids: Collection[PackageId], why: Trouble
) -> MissionRecord:
    """The record with the aim that these packages return to the pickup; new aims are reported."""
    returning = {aim.package_id for aim in record.aims if aim.kind == "RETURN"}
    pickup = record.request.pickup.station_id
    turned = [
        Aim(package_id=each, station_id=pickup, kind="RETURN")
        for each in package_ids
        if each not in returning
    ]
    aims = with_changed_aims(record.aims, turned)
    return with_aims(work, record, aims, why)


async def return_cancelled_packages(
    work: MissionUnitOfWork, record: MissionRecord, packages: Sequence[PackageOnBoard]
) -> MissionRecord:
    """Add cancelled packages to the mission again and have them brought back.

    They were cancelled while the drone loaded them. Without a new plan the drone would deliver
    packages although the customer was notified that they stay.
    """
    pickup = record.request.pickup
    added = tuple(
        Package(package_id=each.package_id, mass_kg=each.mass_kg, destination=pickup)
        for each in packages
    )
    request = record.request.model_copy(update={"packages": (*record.request.packages, *added)})
    record = replace(record, request=request)
    await store.save_request(work.tx, record)
    package_ids = [each.package_id for each in packages]
    detail = f"cancelled, but on board already: {', '.join(package_ids)}"
    return await return_packages(
        work, record, package_ids, Trouble(code="CANCELLED", detail=detail)
    )


async def _ask_to_leave(
    work: MissionUnitOfWork, record: MissionRecord, package_ids: Collection[PackageId], why: Trouble
) -> None:
    """Ask the drone to leave these packages; its answer decides whether they are released."""
    record = _turned_back(work, record, package_ids, why)
    if len(package_ids) < len(record.request.packages):
        await _plan_without(work, record, package_ids, reason=why.detail)
        return
    record = await request_plan(work, record, why)
    await request_call_off(work, record, why)


async def _release(
    work: MissionUnitOfWork, record: MissionRecord, package_ids: Collection[PackageId], why: Trouble
) -> None:
    """Leave these packages at the pickup; a mission with nothing left to carry ends."""
    record = report(
        work,
        record,
        "RELEASED",
        package_ids=tuple(package_ids),
        code=why.code,
        detail=why.detail,
    )
    if len(package_ids) == len(record.request.packages):
        await ending.cancel(work, record, why)
        return
    aims = tuple(aim for aim in record.aims if aim.package_id not in package_ids)
    await _plan_without(work, replace(record, aims=aims), package_ids, reason=why.detail)


async def _plan_without(
    work: MissionUnitOfWork,
    record: MissionRecord,
    package_ids: Collection[PackageId],
    *,
    reason: str,
) -> None:
    """Take these packages out of the request, and have the others planned again."""
    record = await _left_out_of(work, record, package_ids)
    detail = f"{len(package_ids)} packages were cancelled: {reason}"
    await request_plan(work, record, Trouble(code=PACKAGES_CANCELLED, detail=detail))


async def _left_out_of(
    work: MissionUnitOfWork, record: MissionRecord, package_ids: Collection[PackageId]
) -> MissionRecord:
    """The record without these packages; the caller saves its mission.

    A QUEUED mission may then begin as soon as the remaining deliveries allow.
    """
    left = tuple(each for each in record.request.packages if each.package_id not in package_ids)
    etas = tuple(each for each in record.mission.packages if each.package_id not in package_ids)
    request = record.request.model_copy(update={"packages": left})
    if record.mission.state == "QUEUED":
        flying = [each.package_id for each in left]
        at = ready_at(record.shares, flying, planned_at=request.earliest_pickup_at)
        request = request.model_copy(update={"earliest_pickup_at": at})
    record = replace(
        record,
        request=request,
        mission=record.mission.model_copy(update={"packages": etas}),
    )
    await store.save_request(work.tx, record)
    return record
