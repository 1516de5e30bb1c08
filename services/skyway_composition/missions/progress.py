"""Events: what a drone has done becomes custody, mission state and mission reports."""

import logging
from dataclasses import replace
from datetime import datetime

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import DeliverStep, FlightStep, PickUpStep
from skyway.ids import PackageId
from skyway.units import moment_to_ms
from skyway_composition.links.link import DroneLink
from skyway_composition.missions import store
from skyway_composition.missions.custody import Custodian, Held, delivered, may_pass
from skyway_composition.missions.deviation import delayed_etas, lateness
from skyway_composition.missions.ending import abort, complete
from skyway_composition.missions.record import MissionRecord, Stuck
from skyway_composition.missions.report import report
from skyway_composition.missions.states import moved
from skyway_composition.missions.totals import flown_totals
from skyway_composition.missions.watch import Watch

log = logging.getLogger(__name__)


async def take_event(watch: Watch, link: DroneLink, event: DroneEvent) -> None:
    """Take the next event of a drone; a repeated one is dropped, a gap is asked for."""
    is_of_lost_journal = event.stream < link.stream == link.acked_stream
    if is_of_lost_journal or event.seq <= link.last_event_seq:
        return
    if event.seq > link.last_event_seq + 1:
        watch.links[link.drone_id] = await watch.courier.ask_for_events(watch.tx, link)
        return
    await watch.keep_link(replace(link, last_event_seq=event.seq))
    record = watch.missions.get(link.drone_id)
    if record is None or record.mission_id != event.mission_id:
        log.info("event of no live mission", extra={"mission_id": event.mission_id})
        return
    match event.event:
        case "STEP_ENDED":
            await _take_step_end(watch, record, event)
        case "STEP_FAILED":
            await _take_step_failure(watch, record, event)
        case "MISSION_ENDED":
            await _take_mission_end(watch, record, event)
        case "ALARM":
            log.warning("alarm", extra={"drone_id": link.drone_id, "code": event.code})


def accepted(watch: Watch, record: MissionRecord) -> MissionRecord:
    """The record once the drone has taken the mission; whoever flies it has accepted it."""
    if record.mission.state != "BOOKED":
        return record
    record = moved(record, "ACCEPTED")
    return report(watch.tx, record, "ACCEPTED", at=watch.clock.now(), mint=watch.mint)


def begun(watch: Watch, record: MissionRecord, *, at: datetime) -> MissionRecord:
    """The record once the drone has begun: it approaches the pickup, or loads there."""
    record = accepted(watch, record)
    if record.mission.state != "ACCEPTED":
        return record
    record = moved(record, "ACTIVE")
    return report(watch.tx, record, "LOADING", at=at, mint=watch.mint)


async def wait_for_revision(
    watch: Watch, record: MissionRecord, *, code: str, detail: str, last_step: int = 0
) -> None:
    """Note that the drone stands and waits; `recompose` finds it, from where its state says."""
    state = watch.links[record.drone_id].state
    if state is None or state.station_id is None:
        # Not known where it stands: its next state or the end of its plan decides.
        log.warning("stuck nowhere", extra={"mission_id": record.mission_id, "code": code})
        return
    if state.mission_id == record.mission_id:
        last_step = max(last_step, state.released_through or 0, state.step_id or 0)
    stuck = Stuck(
        code=code,
        detail=detail,
        station_id=state.station_id,
        soc=state.soc,
        last_step=last_step,
    )
    await watch.keep(replace(record, stuck=stuck))


async def _take_step_end(watch: Watch, record: MissionRecord, event: DroneEvent) -> None:
    step = await store.end_step(watch.tx, record.mission_id, event, status="ENDED")
    if step is None:
        return
    record = begun(watch, record, at=event.started_at or event.ended_at)
    match step:
        case PickUpStep():
            package_ids = tuple(each.package_id for each in step.packages)
            drone = Custodian("DRONE", record.drone_id)
            passed = await _pass_on(watch, record, package_ids, to=drone, at=event.ended_at)
            if passed:
                record = _report_step(watch, record, "LOADED", event, package_ids=passed)
        case DeliverStep():
            recipient = Custodian("RECIPIENT", step.station_id)
            passed = await _pass_on(
                watch, record, step.package_ids, to=recipient, at=event.ended_at
            )
            flown = flown_totals(await store.steps_of(watch.tx.connection, record.mission_id))
            record = _report_step(
                watch, record, "DELIVERED", event, package_ids=passed, flown=flown
            )
        case _:
            record = await _report_delay(watch, record, step, event)
    await watch.keep(record)


def _report_step(
    watch: Watch,
    record: MissionRecord,
    kind: str,
    event: DroneEvent,
    *,
    package_ids: tuple[PackageId, ...],
    flown: dict[str, float] | None = None,
) -> MissionRecord:
    return report(
        watch.tx,
        record,
        kind,
        at=event.ended_at,
        mint=watch.mint,
        station_id=event.station_id,
        soc=event.soc,
        package_ids=package_ids,
        data=event.data if flown is None else {**event.data, "flown": flown},
    )


async def _report_delay(
    watch: Watch, record: MissionRecord, step: FlightStep, event: DroneEvent
) -> MissionRecord:
    held = await store.held_packages(watch.tx.connection, record.mission.delivery_id)
    late_by = lateness(step, event.ended_at)
    etas = delayed_etas(record, late_by, delivered=delivered(held))
    if not etas:
        return record
    return report(
        watch.tx,
        record,
        "ACTIVITY",
        at=event.ended_at,
        mint=watch.mint,
        station_id=event.station_id,
        soc=event.soc,
        etas=etas,
        data={"late_by_s": late_by.total_seconds()},
    )


async def _take_step_failure(watch: Watch, record: MissionRecord, event: DroneEvent) -> None:
    await store.end_step(watch.tx, record.mission_id, event, status="FAILED")
    record = begun(watch, record, at=event.started_at or event.ended_at)
    if event.station_id is None:
        code, detail = event.code or "STEP_FAILED", event.detail or "a step failed"
        await watch.keep(record)
        await wait_for_revision(
            watch, record, code=code, detail=detail, last_step=event.step_id or 0
        )
        return
    stuck = Stuck(
        code=event.code or "STEP_FAILED",
        detail=event.detail or "a step failed",
        station_id=event.station_id,
        soc=event.soc,
        last_step=event.step_id or 0,
    )
    await watch.keep(replace(record, stuck=stuck))


async def _take_mission_end(watch: Watch, record: MissionRecord, event: DroneEvent) -> None:
    record = begun(watch, record, at=event.ended_at)
    held = await store.held_packages(watch.tx.connection, record.mission.delivery_id)
    missing = {package.package_id for package in record.request.packages} - delivered(held)
    if missing:
        detail = f"the drone ended it with {len(missing)} packages not delivered"
        code = event.code or "NOT_DELIVERED"
        await abort(watch, record, at=event.ended_at, code=code, detail=detail)
    else:
        await complete(watch, record, at=event.ended_at)


async def _pass_on(
    watch: Watch,
    record: MissionRecord,
    package_ids: tuple[PackageId, ...],
    *,
    to: Custodian,
    at: datetime,
) -> tuple[PackageId, ...]:
    """Pass these packages on; those that were already there, or delivered, stay as they are."""
    held = await store.held_packages(watch.tx.connection, record.mission.delivery_id)
    passed = [each for each in package_ids if may_pass(held.get(each), to)]
    rows = [Held(each, held[each].seq + 1 if each in held else 1, to) for each in passed]
    await store.add_custody(watch.tx, record, rows, at_ms=moment_to_ms(at))
    return tuple(passed)
