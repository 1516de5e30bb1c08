"""Recovers packages from a drone that still flies a mission that was given up.

The drone was silent for so long that its mission was ended; other missions may have its pads now.
The drone is instructed to hold at its next landing and to leave its packages there. Operators get
an alarm.
"""

from functools import partial

from skyway.contracts.drone_report import DroneEvent, DroneState
from skyway.contracts.flight_step import DeliverStep, ReturnStep
from skyway.contracts.instruction import MissionInstruction
from skyway.ids import PackageId, StationId
from skyway.runtime.tracing import in_trace_of
from skyway.units import moment_to_ms
from skyway_composition.alarm_store import is_open
from skyway_composition.links.instruction_store import last_revision, open_instructions
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.following.advance import handed_over, why_not_late_hand_over
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.custody_store import (
    Custodian,
    Held,
    has_never_left,
)
from skyway_composition.missions.mission.instruct import hold
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, raise_alarm


async def raise_flies_on(work: MissionUnitOfWork, ended: MissionRecord, state: DroneState) -> None:
    """Raise an alarm about a drone that is back with packages that were given up."""
    await raise_alarm(
        work,
        ended,
        level="CRITICAL",
        code="FLIES_ON",
        detail=(
            f"the drone is back with {', '.join(state.package_ids)} on board, though its mission "
            f"is {ended.mission.state}; it leaves them where it lands next"
        ),
        station_id=state.station_id,
        data={"package_ids": [*state.package_ids], "activity": state.activity},
    )


async def hold_and_unload(work: MissionUnitOfWork, ended: MissionRecord, state: DroneState) -> None:
    """Instruct the drone to hold, and then to leave its packages; each instruction is sent once."""
    if (state.mission_revision or 0) > ended.mission.revision:
        return  # The drone follows the last revision that was sent here.
    sent = {
        each.kind
        for each in await open_instructions(work.tx, ended.drone_id)
        if each.mission_id == ended.mission_id
    }
    if not state.is_held:
        if "HOLD" not in sent:
            await hold(work, ended, reason=f"the mission is {ended.mission.state}")
    elif state.activity == "WAITING" and state.station_id and "MISSION" not in sent:
        await _leave_all(work, ended, state, station=state.station_id)


async def record_late_event(work: MissionUnitOfWork, link: DroneLink, event: DroneEvent) -> None:
    """Note where packages of a mission that is over here were returned or handed over."""
    passes_packages = event.event in ("STEP_ENDED", "STEP_FAILED")
    passes_packages &= event.step_kind in ("RETURN", "DELIVER")
    if event.mission_id is None or event.station_id is None or not passes_packages:
        return
    ended = await store.get(work.tx.connection, event.mission_id, provider_id=None)
    if ended is None or ended.is_live or ended.drone_id != link.drone_id:
        return
    if event.event == "STEP_FAILED":
        step = handed_over(await _delivering_step(work, ended, event), event)
        if step is not None:
            await _record_late_hand_over(work, ended, event, step, station_id=event.station_id)
    elif event.step_kind == "RETURN":
        await _record_late_return(work, ended, event, station_id=event.station_id)
    elif event.code != "CUT":
        step = await _delivering_step(work, ended, event)
        await _record_late_hand_over(work, ended, event, step, station_id=event.station_id)


async def _record_late_return(
    work: MissionUnitOfWork, ended: MissionRecord, event: DroneEvent, *, station_id: StationId
) -> None:
    held = await work.custody.held_on(ended)
    drone, station = Custodian("DRONE", ended.drone_id), Custodian("STATION", station_id)
    rows = [
        Held(each, held[each].seq + 1, station)
        for each in event.package_ids
        if each in held and held[each].custodian == drone
    ]
    await work.custody.add(ended, rows, at_ms=moment_to_ms(event.ended_at))


async def _record_late_hand_over(
    work: MissionUnitOfWork,
    ended: MissionRecord,
    event: DroneEvent,
    step: DeliverStep | None,
    *,
    station_id: StationId,
) -> None:
    """Note a delivery after its mission was given up, and raise an alarm.

    Custody changes only for packages that this mission has loaded and nobody has moved since, and
    not by a report that cannot be true.
    """
    reason = await why_not_late_hand_over(work, ended, step, event)
    if step is None or reason is not None:
        await _raise_not_believed(work, ended, event, reason)
        return
    package_ids = event.package_ids or step.package_ids
    held = await _last_moved_by(work, ended)
    recipient = Custodian("RECIPIENT", station_id)
    rows = [
        Held(each, held[each].seq + 1, recipient)
        for each in package_ids
        if each in held and held[each].custodian.kind != "RECIPIENT"
    ]
    await work.custody.add(ended, rows, at_ms=moment_to_ms(event.ended_at))
    if not rows and await is_open(work.tx.connection, ended.drone_id, code="LATE_HAND_OVER"):
        return
    known = "" if rows else "; by the ledger it had none of them, so people must ask"
    await raise_alarm(
        work,
        ended,
        level="CRITICAL",
        code="LATE_HAND_OVER",
        detail=(
            f"the drone has handed over {', '.join(package_ids)} at {station_id!r}, though its "
            f"mission is {ended.mission.state}: nobody else may deliver them{known}"
        ),
        station_id=station_id,
        data={"package_ids": [*package_ids], "step_id": event.step_id},
    )


async def _last_moved_by(work: MissionUnitOfWork, ended: MissionRecord) -> dict[PackageId, Held]:
    """The packages that this mission has loaded, and that no other has moved since."""
    links = await work.custody.chain_links(ended)
    last = {each.held.package_id: each for each in links}
    return {
        package_id: each.held
        for package_id, each in last.items()
        if each.mission_id == ended.mission_id and not has_never_left(each.held)
    }


async def _delivering_step(
    work: MissionUnitOfWork, ended: MissionRecord, event: DroneEvent
) -> DeliverStep | None:
    """The step that has ended, if it delivers packages."""
    steps = await work.steps.of(ended.mission_id)
    for each in steps:
        if isinstance(each.step, DeliverStep) and each.step.step_id == event.step_id:
            return each.step
    return None


async def _raise_not_believed(
    work: MissionUnitOfWork, ended: MissionRecord, event: DroneEvent, reason: str | None
) -> None:
    """Raise an alarm once: a drone that repeats its report must not hide other alarms."""
    if await is_open(work.tx.connection, ended.drone_id, code="IMPLAUSIBLE"):
        return
    await raise_alarm(
        work,
        ended,
        level="CRITICAL",
        code="IMPLAUSIBLE",
        detail=f"the drone reports a hand-over that cannot be true: {reason}",
        station_id=event.station_id,
        data={"event": event.model_dump(mode="json", exclude_defaults=True)},
    )


async def _leave_all(
    work: MissionUnitOfWork, ended: MissionRecord, state: DroneState, *, station: str
) -> None:
    """Send a last revision: the drone leaves everything here and ends the mission."""
    now, mission = work.clock.now(), ended.mission
    first_step = (state.released_through or 0) + 1
    step = ReturnStep.model_validate(
        {
            "step_id": first_step,
            "planned_start_at": now,
            "planned_end_at": now,
            "station_id": station,
            "package_ids": state.package_ids,
        }
    )
    draft = partial(
        MissionInstruction,
        mission_id=mission.mission_id,
        mission_revision=1 + max(mission.revision, await last_revision(work.tx, ended.mission_id)),
        delivery_id=mission.delivery_id,
        first_step=first_step,
        steps=(step,),
    )
    with in_trace_of(ended.traceparent):
        await work.send(ended.drone_id, draft)
