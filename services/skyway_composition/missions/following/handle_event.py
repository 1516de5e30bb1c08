"""Handles events: a drone's deeds become custody, mission states and mission reports."""

import logging
from dataclasses import replace

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import DeliverStep, PickUpStep, RechargeStep, ReturnStep
from skyway.units import moment_to_ms
from skyway_composition.alarm_store import add as raise_alarm
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.following.advance import (
    begin,
    record_hand_over,
    record_loading,
    record_return,
)
from skyway_composition.missions.following.handle_failure import handle_step_failure
from skyway_composition.missions.following.recover_packages import record_late_event
from skyway_composition.missions.mission.custody_store import delivered, held_packages, returned
from skyway_composition.missions.mission.doubt import without_doubt
from skyway_composition.missions.mission.end import abort, complete
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.release_pads import release_unneeded_pads
from skyway_composition.missions.mission.step_store import end_step, keep_cut_step
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.outlook.check_plan import check_plan_after_step
from skyway_composition.missions.replanning.propose import accept_if_flown
from skyway_composition.missions.replanning.request_plan import request_plan

log = logging.getLogger(__name__)


async def handle_event(work: MissionUnitOfWork, link: DroneLink, event: DroneEvent) -> None:
    """Handle the next event of a drone; drop a repeated one, request missing ones."""
    is_of_lost_journal = event.stream < link.stream == link.acked_stream
    if is_of_lost_journal or event.seq <= link.last_event_seq:
        return
    if event.seq > link.last_event_seq + 1:
        work.links[link.drone_id] = await work.courier.ask_for_events(work.tx, link)
        return
    work.stage_link(replace(link, last_event_seq=event.seq))
    record = work.missions.get(link.drone_id)
    if event.event == "ALARM":
        await _handle_alarm(work, link, event)
    if record is None or record.mission_id != event.mission_id:
        log.info("event of no live mission", extra={"mission_id": event.mission_id})
        await record_late_event(work, link, event)
        return
    record = await accept_if_flown(work, without_doubt(work, record), event.mission_revision)
    match event.event:
        case "STEP_ENDED":
            await _handle_step_end(work, record, event)
        case "STEP_FAILED":
            await handle_step_failure(work, record, event)
        case "MISSION_ENDED":
            await _handle_mission_end(work, record, event)
        case "ALARM":
            await _handle_plan_request(work, record, event)


async def _handle_step_end(
    work: MissionUnitOfWork, record: MissionRecord, event: DroneEvent
) -> None:
    if event.code == "CUT":
        await keep_cut_step(work.tx, record.mission_id, event)
    step = await end_step(work.tx, record.mission_id, event, status="ENDED")
    if step is None:
        return
    record = begin(work, record, at=event.started_at or event.ended_at)
    is_cut = event.code == "CUT"
    match step:
        case PickUpStep() if not is_cut:
            record = await record_loading(work, record, step, event)
        case DeliverStep() if not is_cut:
            record = await record_hand_over(work, record, step, event)
        case ReturnStep() if not is_cut:
            record = await record_return(work, record, step, event)
        case RechargeStep():
            await release_unneeded_pads(work, record)
        case _:
            pass
    work.stage(record)
    if is_cut:
        return
    await check_plan_after_step(work, record, event)


async def _handle_alarm(work: MissionUnitOfWork, link: DroneLink, event: DroneEvent) -> None:
    log.warning("alarm", extra={"drone_id": link.drone_id, "code": event.code})
    await raise_alarm(
        work.tx,
        level=event.level or "WARNING",
        code=event.code or "ALARM",
        detail=event.detail or "the drone raised an alarm",
        at_ms=moment_to_ms(event.ended_at),
        mint=work.mint,
        provider_id=link.provider_id,
        drone_id=link.drone_id,
        mission_id=event.mission_id,
        station_id=event.station_id,
        data=event.data,
    )


async def _handle_plan_request(
    work: MissionUnitOfWork, record: MissionRecord, event: DroneEvent
) -> None:
    """A drone that cannot fly its plan may request another one with PLAN_WANTED."""
    if event.code == "PLAN_WANTED":
        detail = event.detail or "the drone asks for another plan"
        await request_plan(work, record, Trouble(code="PLAN_WANTED", detail=detail))


async def _handle_mission_end(
    work: MissionUnitOfWork, record: MissionRecord, event: DroneEvent
) -> None:
    record = begin(work, record, at=event.ended_at)
    held = record.own(await held_packages(work.tx.connection, record.mission.delivery_id))
    back = returned(held, record.request.pickup.station_id)
    missing = {each.package_id for each in record.request.packages} - delivered(held) - back
    if not missing:
        await complete(work, record, at=event.ended_at)
        return
    given_up = record.mission.given_up
    detail = f"the drone ended it with {len(missing)} packages not delivered"
    if given_up is not None:
        detail = f"no way was left to deliver or return {len(missing)} packages"
    await abort(
        work,
        record,
        at=event.ended_at,
        code=given_up or event.code or "NOT_DELIVERED",
        detail=detail,
        station_id=event.station_id,
    )
