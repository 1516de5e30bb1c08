"""Stopping packages of a mission: left at the pickup, or brought back there."""

from collections.abc import Collection
from dataclasses import replace
from typing import Final

from skyway.contracts.mission import Cancellation
from skyway.ids import PackageId
from skyway_composition.missions import ending
from skyway_composition.missions.custody.chain import Custodian
from skyway_composition.missions.custody.store import held_packages
from skyway_composition.missions.hands import store
from skyway_composition.missions.hands.recall import can_be_kept_off, has_never_left
from skyway_composition.missions.record import Aim, MissionRecord, Trouble
from skyway_composition.missions.report import report
from skyway_composition.missions.rest.aiming import aimed
from skyway_composition.missions.revisions.telling import with_aims
from skyway_composition.missions.steps.store import steps_of
from skyway_composition.missions.trouble import troubled
from skyway_composition.missions.watch import Watch

#: Why a mission that carries fewer packages from now on needs another plan.
PACKAGES_CANCELLED: Final = "PACKAGES_CANCELLED"


async def stop_packages(
    watch: Watch,
    record: MissionRecord,
    package_ids: Collection[PackageId],
    *,
    code: str,
    reason: str,
) -> Cancellation:
    """Do what can still be done about these packages of a live mission.

    Those at the pickup stay there, and without any left the mission is over. Those on board come
    back. A drone that takes packages on board this very moment brings them back, too; one that has
    not said yet that it flies the mission at all cannot be told anything now.
    """
    held = await held_packages(watch.tx.connection, record.mission.delivery_id)
    own = [each.package_id for each in record.packages(frozenset(package_ids))]
    drone = Custodian("DRONE", record.drone_id)
    carried = [each for each in own if each in held and held[each].custodian == drone]
    waiting = [each for each in own if has_never_left(held.get(each))]
    too_late = [each for each in own if each not in carried and each not in waiting]

    steps = await steps_of(watch.tx.connection, record.mission_id)
    takes_others = len(waiting) < len(record.request.packages)
    link = watch.links[record.drone_id]
    if waiting and not can_be_kept_off(
        record, steps, watch.clock, link=link, needs_plan=takes_others
    ):
        if record.mission.state == "BOOKED":
            too_late += waiting
        else:
            carried += waiting
        waiting = []
    if carried:
        record = await bring_back(watch, record, carried, code=code, detail=reason)
    if waiting:
        await _release(watch, record, waiting, code=code, reason=reason)
    return Cancellation(released=tuple(waiting), returning=tuple(carried), too_late=tuple(too_late))


async def bring_back(
    watch: Watch,
    record: MissionRecord,
    package_ids: Collection[PackageId],
    *,
    code: str,
    detail: str,
) -> MissionRecord:
    """Have the drone hand these back at the pickup instead of delivering them."""
    known = {aim.package_id for aim in record.aims if aim.kind == "RETURN"}
    pickup = record.request.pickup.station_id
    turned = [
        Aim(package_id=each, station_id=pickup, kind="RETURN")
        for each in package_ids
        if each not in known
    ]
    record = with_aims(watch, record, aimed(record.aims, turned), code=code, detail=detail)
    return await troubled(watch, record, Trouble(code=code, detail=detail))


async def _release(
    watch: Watch,
    record: MissionRecord,
    package_ids: Collection[PackageId],
    *,
    code: str,
    reason: str,
) -> None:
    """Leave these at the pickup; a mission with nothing left to carry is over."""
    record = report(
        watch,
        record,
        "RELEASED",
        at=watch.clock.now(),
        package_ids=tuple(package_ids),
        code=code,
        detail=reason,
    )
    left = tuple(each for each in record.request.packages if each.package_id not in package_ids)
    if not left:
        await ending.cancel(watch, record, code=code, detail=reason)
        return
    etas = tuple(each for each in record.mission.packages if each.package_id not in package_ids)
    record = replace(
        record,
        request=record.request.model_copy(update={"packages": left}),
        mission=record.mission.model_copy(update={"packages": etas}),
        aims=tuple(aim for aim in record.aims if aim.package_id not in package_ids),
    )
    await store.save_request(watch.tx, record)
    detail = f"{len(package_ids)} packages were cancelled: {reason}"
    await troubled(watch, record, Trouble(code=PACKAGES_CANCELLED, detail=detail))
