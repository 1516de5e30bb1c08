"""Packages change hands: custody is passed on, and those who wait for them are told."""

from collections.abc import Iterable
from datetime import datetime

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import DeliverStep, PickUpStep, ReturnStep
from skyway.ids import PackageId
from skyway.units import moment_to_ms
from skyway_composition.missions.interventions.stop_packages import return_cancelled_packages
from skyway_composition.missions.mission.custody import Custodian, Held, may_pass
from skyway_composition.missions.mission.custody_store import add_custody, held_packages
from skyway_composition.missions.mission.notify import report
from skyway_composition.missions.mission.record import MissionRecord, moved
from skyway_composition.missions.mission.step_record import flown_totals
from skyway_composition.missions.mission.step_store import ended_events
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork


async def record_loading(
    work: MissionUnitOfWork, record: MissionRecord, step: PickUpStep, event: DroneEvent
) -> MissionRecord:
    """The record once the drone has its packages, and brings those back that were cancelled."""
    wanted = {each.package_id for each in record.request.packages}
    # A loader confirms the wanted ones only.
    supposed = {each.package_id for each in step.packages}
    taken = set(event.package_ids) or (supposed & wanted if step.awaits_confirmation else supposed)
    package_ids = [each.package_id for each in step.packages if each.package_id in taken]
    drone = Custodian("DRONE", record.drone_id)
    passed = await _pass_on(work, record, package_ids, to=drone, event=event)
    if passed:
        record = _told(work, record, "LOADED", event, passed)
    astray = [each for each in step.packages if each.package_id in taken - wanted]
    return await return_cancelled_packages(work, record, astray) if astray else record


async def record_hand_over(
    work: MissionUnitOfWork, record: MissionRecord, step: DeliverStep, event: DroneEvent
) -> MissionRecord:
    """The record once recipients have their packages, with what that took so far."""
    recipient = Custodian("RECIPIENT", step.station_id)
    passed = await _pass_on(work, record, step.package_ids, to=recipient, event=event)
    flown = flown_totals(await ended_events(work.tx.connection, record.mission_id))
    return _told(work, record, "DELIVERED", event, passed, flown=flown)


async def record_return(
    work: MissionUnitOfWork, record: MissionRecord, step: ReturnStep, event: DroneEvent
) -> MissionRecord:
    """The record once a station has packages back; elsewhere than at the pickup they strand.

    Those are told of at the mission's end.
    """
    station = Custodian("STATION", step.station_id)
    passed = await _pass_on(work, record, step.package_ids, to=station, event=event)
    if not passed or step.station_id != record.request.pickup.station_id:
        return record
    return _told(work, record, "RETURNED", event, passed)


def _told(
    work: MissionUnitOfWork,
    record: MissionRecord,
    kind: str,
    event: DroneEvent,
    package_ids: tuple[PackageId, ...],
    *,
    flown: dict[str, float] | None = None,
) -> MissionRecord:
    return report(
        work,
        record,
        kind,
        at=event.ended_at,
        station_id=event.station_id,
        soc=event.soc,
        package_ids=package_ids,
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
    """Pass these packages on; those that were already there, or delivered, stay as they are."""
    held = await held_packages(work.tx.connection, record.mission.delivery_id)
    passed = [each for each in package_ids if may_pass(held.get(each), to)]
    rows = [Held(each, held[each].seq + 1 if each in held else 1, to) for each in passed]
    await add_custody(work.tx, record, rows, at_ms=moment_to_ms(event.ended_at))
    return tuple(passed)


def accept(work: MissionUnitOfWork, record: MissionRecord) -> MissionRecord:
    """The record once the drone has taken the mission; whoever flies it has accepted it."""
    if record.mission.state != "BOOKED":
        return record
    record = moved(record, "ACCEPTED")
    return report(work, record, "ACCEPTED", at=work.clock.now())


def begin(work: MissionUnitOfWork, record: MissionRecord, *, at: datetime) -> MissionRecord:
    """The record once the drone has begun: it approaches the pickup, or loads there."""
    record = accept(work, record)
    if record.mission.state != "ACCEPTED":
        return record
    record = moved(record, "ACTIVE")
    return report(work, record, "LOADING", at=at)
