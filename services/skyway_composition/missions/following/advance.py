"""Advances a mission: accepted, begun, packages loaded, delivered, returned.

Each change of custody is saved and reported.
"""

from collections.abc import Iterable
from datetime import datetime

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import DeliverStep, PickUpStep, ReturnStep
from skyway.contracts.mission import Mission
from skyway.ids import PackageId
from skyway.units import moment_to_ms
from skyway_composition.missions.interventions.stop_packages import return_cancelled_packages
from skyway_composition.missions.mission.custody_store import (
    Custodian,
    Held,
    carried_by,
    may_load,
)
from skyway_composition.missions.mission.record import MissionRecord, moved
from skyway_composition.missions.mission.share_views import with_pooled_price
from skyway_composition.missions.mission.step_store import flown_totals
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, free_from, report
from skyway_composition.missions.replanning.store import plan_now


def accept(work: MissionUnitOfWork, record: MissionRecord) -> MissionRecord:
    """Note that the drone has accepted the mission; a drone that flies it has accepted it."""
    if record.mission.state != "BOOKED":
        return record
    record = moved(record, "ACCEPTED")
    return report(work, record, "ACCEPTED", at=work.clock.now(), free_from=free_from(record))


def begin(work: MissionUnitOfWork, record: MissionRecord, *, at: datetime) -> MissionRecord:
    """Note that the drone has begun: it approaches the pickup, or loads there."""
    record = accept(work, record)
    if record.mission.state != "ACCEPTED":
        return record
    record = moved(record, "ACTIVE")
    return report(work, record, "LOADING", at=at)


async def record_loading(
    work: MissionUnitOfWork, record: MissionRecord, step: PickUpStep, event: DroneEvent
) -> MissionRecord:
    """Note which packages are on board; cancelled packages are brought back."""
    requested = {each.package_id for each in record.request.packages}
    # A loader confirms only packages that are still requested.
    planned = {each.package_id for each in step.packages}
    default = planned & requested if step.awaits_confirmation else planned
    taken = set(event.package_ids) or default
    package_ids = [each.package_id for each in step.packages if each.package_id in taken]
    drone = Custodian("DRONE", record.drone_id)
    passed = await _pass_on(work, record, package_ids, to=drone, event=event)
    if passed:
        record = _report_loaded(work, record, event, passed)
    if passed and record.needs_plan:
        # Planning may wait for the drone's cancellation, which now comes too late.
        await plan_now(work.tx, record.mission_id)
    cancelled = [each for each in step.packages if each.package_id in taken - requested]
    return await return_cancelled_packages(work, record, cancelled) if cancelled else record


async def record_hand_over(
    work: MissionUnitOfWork, record: MissionRecord, step: DeliverStep, event: DroneEvent
) -> MissionRecord:
    """Note that recipients have their packages, and report the totals so far."""
    recipient = Custodian("RECIPIENT", step.station_id)
    passed = await _pass_on(work, record, step.package_ids, to=recipient, event=event)
    flown = flown_totals(await work.steps.ended_events(record.mission_id))
    return _report(work, record, "DELIVERED", event, passed, flown=flown)


async def record_return(
    work: MissionUnitOfWork, record: MissionRecord, step: ReturnStep, event: DroneEvent
) -> MissionRecord:
    """Note that a station has packages back.

    Packages that are handed back elsewhere than at the pickup are stranded; the report at the end
    of the mission names them.
    """
    station = Custodian("STATION", step.station_id)
    passed = await _pass_on(work, record, step.package_ids, to=station, event=event)
    if not passed or step.station_id != record.request.pickup.station_id:
        return record
    return _report(work, record, "RETURNED", event, passed)


def _report_loaded(
    work: MissionUnitOfWork,
    record: MissionRecord,
    event: DroneEvent,
    package_ids: tuple[PackageId, ...],
) -> MissionRecord:
    """Report what is on board; deliveries that were loaded together pay the pooled price."""
    pooled = with_pooled_price(record, package_ids)
    mission = None if pooled is record else pooled.mission
    return _report(work, pooled, "LOADED", event, package_ids, mission=mission)


def _report(
    work: MissionUnitOfWork,
    record: MissionRecord,
    kind: str,
    event: DroneEvent,
    package_ids: tuple[PackageId, ...],
    *,
    flown: dict[str, float] | None = None,
    mission: Mission | None = None,
) -> MissionRecord:
    return report(
        work,
        record,
        kind,
        at=event.ended_at,
        station_id=event.station_id,
        soc=event.soc,
        package_ids=package_ids,
        mission=mission,
        data=event.data if flown is None else {**event.data, "flown": flown},
    )


async def _pass_on(
    work: MissionUnitOfWork,
    record: MissionRecord,
    package_ids: Iterable[PackageId],
    *,
    to: Custodian,
    event: DroneEvent,
) -> tuple[PackageId, ...]:
    """Pass on those of these packages that their custodian has to pass on.

    A drone loads what a station has, and hands over only what it has itself.
    """
    held = await work.custody.held_on(record)
    if to.kind == "DRONE":
        passed = [each for each in package_ids if may_load(held.get(each))]
    else:
        carried = carried_by(held, record.drone_id)
        passed = [each for each in package_ids if each in carried]
    rows = [Held(each, held[each].seq + 1 if each in held else 1, to) for each in passed]
    await work.custody.add(record, rows, at_ms=moment_to_ms(event.ended_at))
    return tuple(passed)
