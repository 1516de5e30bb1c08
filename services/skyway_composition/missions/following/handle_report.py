"""Handles what drones report: their events, their alarms, and their states.

Events become custody, mission states and mission reports. A state shows what was missed.
"""

import logging
from dataclasses import replace
from typing import Final

from skyway.contracts.drone_report import DroneEvent, DroneState, Fault
from skyway.contracts.flight_step import DeliverStep, PickUpStep, RechargeStep, ReturnStep
from skyway.ids import DroneId, MissionId
from skyway.runtime.metrics import count
from skyway.runtime.mqtt.moments import earliest_believed
from skyway.units import moment_to_ms
from skyway_composition.alarm_store import add as raise_alarm
from skyway_composition.alarm_store import has_room
from skyway_composition.links.instruction_store import last_cancel
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.following.advance import (
    begin,
    handed_over,
    is_believed,
    record_hand_over,
    record_loading,
    record_return,
)
from skyway_composition.missions.following.await_proof import (
    handle_awaited_proofs,
    handle_entered_pin,
)
from skyway_composition.missions.following.handle_failure import (
    doubt_lost_journal,
    handle_step_failure,
    open_stream,
)
from skyway_composition.missions.following.recover_packages import (
    hold_and_unload,
    raise_flies_on,
    record_late_event,
)
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.custody_store import (
    delivered,
    on_board,
    returned,
)
from skyway_composition.missions.mission.end import abort, complete, is_disbelieved, without_doubt
from skyway_composition.missions.mission.instruct import call_off_revision
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.standby import release_unneeded_pads
from skyway_composition.missions.mission.step_store import keep_cut_step
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, report
from skyway_composition.missions.replanning.check_plan import (
    check_plan,
    check_plan_after_step,
    request_plan,
)
from skyway_composition.missions.replanning.propose import accept_if_flown
from skyway_composition.planning.problem_for import used_more

log = logging.getLogger(__name__)

#: The activities that customers see; loading has its own reports.
_REPORTED_ACTIVITIES: Final = ("FLYING", "WAITING", "RECHARGING", "DELIVERING")
_ACTIVITIES_AFTER_START: Final = ("LOADING", "FLYING", "RECHARGING", "DELIVERING")


async def handle_event(work: MissionUnitOfWork, link: DroneLink, event: DroneEvent) -> None:
    """Handle the next event of a drone; drop a repeated one, request missing ones."""
    is_of_lost_journal = event.stream < link.stream == link.acked_stream
    if is_of_lost_journal or link.is_before_journal(event) or event.seq <= link.last_event_seq:
        return
    if event.seq > link.last_event_seq + 1:
        work.links[link.drone_id] = await work.courier.ask_for_events(work.tx, link)
        return
    work.stage_link(replace(link, last_event_seq=event.seq))
    record = work.missions.get(link.drone_id)
    if event.event == "ALARM":
        await handle_alarm(work, link, event)
    if record is None or record.mission_id != event.mission_id:
        log.info("event of no live mission", extra={"mission_id": event.mission_id})
        await record_late_event(work, link, event)
        return
    if is_disbelieved(record):
        return
    record = await accept_if_flown(work, without_doubt(work, record), event.mission_revision)
    match event.event:
        case "STEP_ENDED":
            await _handle_step_end(work, record, event)
        case "ALARM":
            await _handle_plan_request(work, record, event)
        case _:
            await _handle_other(work, record, event)


async def _handle_other(work: MissionUnitOfWork, record: MissionRecord, event: DroneEvent) -> None:
    """Handle a failure, a wait for proofs, or the end of the mission, if it can be true."""
    step = await work.steps.planned(record.mission_id, event)
    done = handed_over(step, event) if event.event == "STEP_FAILED" else step
    if not await is_believed(work, record, done, event):
        return
    match event.event:
        case "STEP_FAILED":
            await handle_step_failure(work, record, event)
        case "HAND_OVER_AWAITED":
            await handle_awaited_proofs(work, record, step, event)
        case "PIN_ENTERED":
            await handle_entered_pin(work, record, step, event)
        case "MISSION_ENDED":
            await _handle_mission_end(work, record, event)


async def _handle_step_end(
    work: MissionUnitOfWork, record: MissionRecord, event: DroneEvent
) -> None:
    step = await work.steps.planned(record.mission_id, event)
    if (step or event.code == "CUT") and not await is_believed(work, record, step, event):
        return
    if event.code == "CUT":
        await keep_cut_step(work.tx, record.mission_id, event)
    if step is None:
        return
    await work.steps.end(record.mission_id, event, status="ENDED")
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


async def _handle_plan_request(
    work: MissionUnitOfWork, record: MissionRecord, event: DroneEvent
) -> None:
    """A drone that cannot fly its plan may request another one with PLAN_WANTED."""
    if event.code == PLAN_REQUEST:
        detail = event.detail or "the drone asks for another plan"
        await request_plan(work, record, Trouble(code=PLAN_REQUEST, detail=detail))


async def _handle_mission_end(
    work: MissionUnitOfWork, record: MissionRecord, event: DroneEvent
) -> None:
    record = begin(work, record, at=event.ended_at)
    held = record.own(await work.custody.held_on(record))
    back = returned(held, record.request.pickup.station_id)
    missing = {each.package_id for each in record.request.packages} - delivered(held) - back
    if not missing:
        await complete(work, record, at=event.ended_at)
        return
    given_up = record.mission.given_up
    detail = f"the drone ended it with {len(missing)} packages not delivered"
    if given_up is not None:
        detail = f"no way was left to deliver or return {len(missing)} packages"
    why = Trouble(code=given_up or event.code or "NOT_DELIVERED", detail=detail)
    await abort(work, record, why, at=event.ended_at, station_id=event.station_id)


async def handle_state(work: MissionUnitOfWork, link: DroneLink, state: DroneState) -> None:
    """Handle a newer state; check whether the drone lost its journal, or we missed its events."""
    if not link.is_newer_state(state):
        return
    must_open_stream = link.needs_new_stream(state) or _has_forgotten_mission(work, link, state)
    may_have_lost_journal = link.may_have_lost_journal(state)
    if link.has_new_journal(state) and state.stream == link.stream:
        # The drone has answered an instruction of this stream since, and numbers its events anew.
        link = replace(link, last_event_seq=0)
    is_news = _is_news(link.state, state)
    link = replace(link.without_foreign_events(state), state=state)
    if state.stream == link.stream:
        link = link.acked(state.stream, state.session)
    elif link.acked_stream < link.stream:
        # The drone has not accepted any instruction of this stream, so its past events do not
        # matter.
        link = replace(link, last_event_seq=state.last_event_seq)
    if must_open_stream:
        await open_stream(work, link, state)
        return
    work.stage_link(link)
    if state.stream == link.stream and state.last_event_seq > link.last_event_seq:
        work.links[link.drone_id] = await work.courier.ask_for_events(work.tx, link)
    record = work.missions.get(link.drone_id)
    if record is not None and record.mission.state == "BOOKED" and may_have_lost_journal:
        record = await doubt_lost_journal(work, record, state)
    if record is not None and state.mission_id == record.mission_id:
        record = without_doubt(work, record)
        record = await accept_if_flown(work, record, state.mission_revision)
        record = await _with_progress(work, record, state)
        if is_news:
            await check_plan(work, record)
    elif state.mission_id is not None:
        await _call_off_if_over(work, link.drone_id, state.mission_id, state)


def _has_forgotten_mission(work: MissionUnitOfWork, link: DroneLink, state: DroneState) -> bool:
    """Whether the drone has lost its journal, and with it a mission that it had accepted.

    Its answer to an instruction may come before this state, and then hides the older stream.
    """
    record = work.missions.get(link.drone_id)
    return (
        record is not None
        and record.mission.state != "BOOKED"
        and state.mission_id != record.mission_id
        and link.has_new_journal(state)
    )


def _is_news(before: DroneState | None, state: DroneState) -> bool:
    """Whether the plan must be checked against this state.

    The end of a step was checked when its event came, against the plan of that time. Alarms and
    cut steps were not, so a state after them must be checked.
    """
    if before is None or before.last_event_seq == state.last_event_seq:
        return True
    if _plan(before) != _plan(state) or before.step_id == state.step_id:
        return True
    return bool(set(state.faults) - set(before.faults)) or _used_more(state) > _used_more(before)


def _plan(state: DroneState) -> tuple[MissionId | None, int | None]:
    return state.mission_id, state.mission_revision


def _used_more(state: DroneState) -> float:
    return 0.0 if state.health is None else used_more(state.health.consumption_factor)


async def _call_off_if_over(
    work: MissionUnitOfWork, drone_id: DroneId, mission_id: MissionId, state: DroneState
) -> None:
    """Instruct the drone to cancel a mission that ended here without its knowledge."""
    ended = await store.get(work.tx.connection, mission_id, provider_id=None)
    sent = await last_cancel(work.tx, work.links[drone_id], mission_id)
    # The drone answers a CANCEL with such a state, until it has landed or handed over.
    is_answered = (
        sent is not None
        and state.last_event_seq <= sent.events_confirmed_seq
        and work.clock.now() <= sent.expires_at
    )
    if ended is None or ended.drone_id != drone_id:
        return
    if not is_answered:
        revision = state.mission_revision or ended.mission.revision
        reason = "the mission was given up without the drone's knowledge"
        await call_off_revision(work, drone_id, mission_id, revision, reason=reason)
    if state.package_ids and state.activity != "DOWN":
        if sent is None:
            await raise_flies_on(work, ended, state)
        await hold_and_unload(work, ended, state)


async def _with_progress(
    work: MissionUnitOfWork, record: MissionRecord, state: DroneState
) -> MissionRecord:
    before = record
    if state.step_id is not None and state.activity in _ACTIVITIES_AFTER_START:
        record = begin(work, record, at=state.at)
    record = await _with_reported_activity(work, record, state)
    if record is not before:
        work.stage(record)
    return record


async def _with_reported_activity(
    work: MissionUnitOfWork, record: MissionRecord, state: DroneState
) -> MissionRecord:
    """Report the drone's activity to the customer if it changed while packages are on board."""
    doing = f"{state.activity} {state.station_id or ''}"
    if state.activity not in _REPORTED_ACTIVITIES or doing == record.reported_activity:
        return record
    held = await work.custody.held_on(record)
    if not on_board(record.own(held)):
        return record
    return report(
        work,
        replace(record, reported_activity=doing),
        "ACTIVITY",
        at=state.at,
        activity=state.activity,
        station_id=state.station_id,
        soc=state.soc,
    )


#: The request of a drone for another plan.
PLAN_REQUEST: Final = "PLAN_WANTED"

#: The codes that a drone may use. All others are ours: an open alarm of ours is raised only once,
#: so a drone that raised it first would hide it.
_CODES_OF_DRONES: Final = frozenset((*Fault, PLAN_REQUEST))
_OTHER: Final = "ALARM"


async def handle_alarm(work: MissionUnitOfWork, link: DroneLink, event: DroneEvent) -> None:
    """Raise the alarm of a drone, unless too many of it or of its provider's drones are open."""
    log.warning("alarm", extra={"drone_id": link.drone_id, "code": event.code})
    level = event.level or "WARNING"
    code, detail = _in_our_words(event)
    if not await has_room(work.tx.connection, link.provider_id, link.drone_id, level):
        count("skyway_alarms_left_out", "alarms of drones that have too many open ones")
        return
    await raise_alarm(
        work.tx,
        level=level,
        code=code,
        detail=detail,
        # A drone that was away sends its alarms when it is connected again.
        at_ms=moment_to_ms(max(event.ended_at, earliest_believed(work.clock))),
        mint=work.mint,
        provider_id=link.provider_id,
        drone_id=link.drone_id,
        mission_id=event.mission_id,
        station_id=event.station_id,
        data=event.data,
    )


def _in_our_words(event: DroneEvent) -> tuple[str, str]:
    """Code and detail of the alarm; a code that no drone may use goes into the detail."""
    detail = event.detail or "the drone raised an alarm"
    if event.code is None or event.code in _CODES_OF_DRONES:
        return event.code or _OTHER, detail
    return _OTHER, f"{event.code}: {detail}"
