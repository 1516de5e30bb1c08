"""Events: what a drone has done becomes custody, mission state and mission reports."""

import logging
from dataclasses import replace

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import DeliverStep, PickUpStep, RechargeStep, ReturnStep
from skyway.units import moment_to_ms
from skyway_composition.alarms.store import add as raise_alarm
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.following.advance import begun, hand_back, hand_over, take_on_board
from skyway_composition.missions.following.handle_failure import take_step_failure
from skyway_composition.missions.following.recover_packages import take_return
from skyway_composition.missions.mission import step_store as cut_steps
from skyway_composition.missions.mission.custody import delivered, returned
from skyway_composition.missions.mission.custody_store import held_packages
from skyway_composition.missions.mission.end import abort, complete
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.release_pads import give_back
from skyway_composition.missions.mission.step_store import end_step
from skyway_composition.missions.mission.unit_of_work import Watch
from skyway_composition.missions.replanning.outlook.judge import judged_after_step
from skyway_composition.missions.replanning.propose import settle_if_flown
from skyway_composition.missions.replanning.request_plan import troubled

log = logging.getLogger(__name__)


async def take_event(watch: Watch, link: DroneLink, event: DroneEvent) -> None:
    """Take the next event of a drone; a repeated one is dropped, a gap is asked for."""
    is_of_lost_journal = event.stream < link.stream == link.acked_stream
    if is_of_lost_journal or event.seq <= link.last_event_seq:
        return
    if event.seq > link.last_event_seq + 1:
        watch.links[link.drone_id] = await watch.courier.ask_for_events(watch.tx, link)
        return
    watch.note_link(replace(link, last_event_seq=event.seq))
    record = watch.missions.get(link.drone_id)
    if event.event == "ALARM":
        await _take_alarm(watch, link, event)
    if record is None or record.mission_id != event.mission_id:
        log.info("event of no live mission", extra={"mission_id": event.mission_id})
        await take_return(watch, event)
        return
    record = await settle_if_flown(watch, record, event.mission_revision)
    match event.event:
        case "STEP_ENDED":
            await _take_step_end(watch, record, event)
        case "STEP_FAILED":
            await take_step_failure(watch, record, event)
        case "MISSION_ENDED":
            await _take_mission_end(watch, record, event)
        case "ALARM":
            await _take_wish(watch, record, event)


async def _take_step_end(watch: Watch, record: MissionRecord, event: DroneEvent) -> None:
    if event.code == "CUT":
        await cut_steps.keep(watch.tx, record.mission_id, event)
    step = await end_step(watch.tx, record.mission_id, event, status="ENDED")
    if step is None:
        return
    record = begun(watch, record, at=event.started_at or event.ended_at)
    is_cut = event.code == "CUT"
    match step:
        case PickUpStep() if not is_cut:
            record = await take_on_board(watch, record, step, event)
        case DeliverStep() if not is_cut:
            record = await hand_over(watch, record, step, event)
        case ReturnStep() if not is_cut:
            record = await hand_back(watch, record, step, event)
        case RechargeStep():
            await give_back(watch, record)
        case _:
            pass
    watch.note(record)
    if is_cut:
        return
    await judged_after_step(watch, record, event)


async def _take_alarm(watch: Watch, link: DroneLink, event: DroneEvent) -> None:
    log.warning("alarm", extra={"drone_id": link.drone_id, "code": event.code})
    await raise_alarm(
        watch.tx,
        level=event.level or "WARNING",
        code=event.code or "ALARM",
        detail=event.detail or "the drone raised an alarm",
        at_ms=moment_to_ms(event.ended_at),
        mint=watch.mint,
        provider_id=link.provider_id,
        drone_id=link.drone_id,
        mission_id=event.mission_id,
        station_id=event.station_id,
        data=event.data,
    )


async def _take_wish(watch: Watch, record: MissionRecord, event: DroneEvent) -> None:
    """A drone that cannot fly its plan may ask for another one."""
    if event.code == "PLAN_WANTED":
        detail = event.detail or "the drone asks for another plan"
        await troubled(watch, record, Trouble(code="PLAN_WANTED", detail=detail))


async def _take_mission_end(watch: Watch, record: MissionRecord, event: DroneEvent) -> None:
    record = begun(watch, record, at=event.ended_at)
    held = record.own(await held_packages(watch.tx.connection, record.mission.delivery_id))
    back = returned(held, record.request.pickup.station_id)
    missing = {each.package_id for each in record.request.packages} - delivered(held) - back
    if not missing:
        await complete(watch, record, at=event.ended_at)
        return
    given_up = record.mission.given_up
    detail = f"the drone ended it with {len(missing)} packages not delivered"
    if given_up is not None:
        detail = f"no way was left to deliver or return {len(missing)} packages"
    await abort(
        watch,
        record,
        at=event.ended_at,
        code=given_up or event.code or "NOT_DELIVERED",
        detail=detail,
        station_id=event.station_id,
    )
