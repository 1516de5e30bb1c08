"""Stops packages of a mission: they stay at the pickup, or are brought back there."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Final

from skyway.contracts.flight_step import PackageOnBoard
from skyway.contracts.mission import Cancellation
from skyway.delivery.request import Package
from skyway.ids import PackageId
from skyway_composition.missions.interventions import store
from skyway_composition.missions.mission import end as ending
from skyway_composition.missions.mission.custody import Custodian, has_never_left
from skyway_composition.missions.mission.custody_store import held_packages
from skyway_composition.missions.mission.notify import report
from skyway_composition.missions.mission.pickup import can_stay_at_pickup
from skyway_composition.missions.mission.record import Aim, MissionRecord, Trouble
from skyway_composition.missions.mission.step_store import steps_of
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.propose import with_aims
from skyway_composition.missions.replanning.remainder.aims import with_changed_aims
from skyway_composition.missions.replanning.request_plan import request_plan

#: The trouble code of a mission that needs another plan because it carries fewer packages.
PACKAGES_CANCELLED: Final = "PACKAGES_CANCELLED"


async def stop_packages(
    work: MissionUnitOfWork,
    record: MissionRecord,
    package_ids: Collection[PackageId],
    *,
    code: str,
    reason: str,
) -> Cancellation:
    """Cancel these packages of a live mission, as far as possible.

    Packages at the pickup stay there; a mission with no package left ends. Packages on board come
    back, also those that are being loaded now. A drone that has not accepted the mission yet cannot
    be instructed in time: its packages are too late to cancel.
    """
    held = await held_packages(work.tx.connection, record.mission.delivery_id)
    own = [each.package_id for each in record.packages(frozenset(package_ids))]
    drone = Custodian("DRONE", record.drone_id)
    carried = [each for each in own if each in held and held[each].custodian == drone]
    waiting = [each for each in own if has_never_left(held.get(each))]
    too_late = [each for each in own if each not in carried and each not in waiting]

    steps = await steps_of(work.tx.connection, record.mission_id)
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
        record = await return_packages(work, record, carried, code=code, detail=reason)
    if waiting:
        await _release(work, record, waiting, code=code, reason=reason)
    return Cancellation(released=tuple(waiting), returning=tuple(carried), too_late=tuple(too_late))


async def return_packages(
    work: MissionUnitOfWork,
    record: MissionRecord,
    package_ids: Collection[PackageId],
    *,
    code: str,
    detail: str,
) -> MissionRecord:
    """Have the drone return these packages to the pickup instead of delivering them."""
    returning = {aim.package_id for aim in record.aims if aim.kind == "RETURN"}
    pickup = record.request.pickup.station_id
    turned = [
        Aim(package_id=each, station_id=pickup, kind="RETURN")
        for each in package_ids
        if each not in returning
    ]
    record = with_aims(
        work, record, with_changed_aims(record.aims, turned), code=code, detail=detail
    )
    return await request_plan(work, record, Trouble(code=code, detail=detail))


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
    return await return_packages(work, record, package_ids, code="CANCELLED", detail=detail)


async def _release(
    work: MissionUnitOfWork,
    record: MissionRecord,
    package_ids: Collection[PackageId],
    *,
    code: str,
    reason: str,
) -> None:
    """Leave these packages at the pickup; a mission with nothing left to carry ends."""
    record = report(
        work,
        record,
        "RELEASED",
        at=work.clock.now(),
        package_ids=tuple(package_ids),
        code=code,
        detail=reason,
    )
    left = tuple(each for each in record.request.packages if each.package_id not in package_ids)
    if not left:
        await ending.cancel(work, record, code=code, detail=reason)
        return
    etas = tuple(each for each in record.mission.packages if each.package_id not in package_ids)
    record = replace(
        record,
        request=record.request.model_copy(update={"packages": left}),
        mission=record.mission.model_copy(update={"packages": etas}),
        aims=tuple(aim for aim in record.aims if aim.package_id not in package_ids),
    )
    await store.save_request(work.tx, record)
    detail = f"{len(package_ids)} packages were cancelled: {reason}"
    await request_plan(work, record, Trouble(code=PACKAGES_CANCELLED, detail=detail))
