"""A drone that stands and waits: a step failed, it refused a revision, it lost its journal."""

import logging
from dataclasses import replace

from skyway.contracts.drone_health import Fault
from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import DeliverStep, FlightStep, FlyStep
from skyway_composition.missions import store
from skyway_composition.missions.following.beginning import begun
from skyway_composition.missions.following.forced_landing import take_forced_landing
from skyway_composition.missions.following.unknown_hand_over import UNKNOWN, take_unknown_hand_over
from skyway_composition.missions.recomposing.occupied_pads import occupied_pad
from skyway_composition.missions.record import MissionRecord, Stuck
from skyway_composition.missions.report import report
from skyway_composition.missions.rest.aiming import absent_aim, aimed
from skyway_composition.missions.revisions.telling import with_aims
from skyway_composition.missions.steps.store import end_step
from skyway_composition.missions.watch import Watch

log = logging.getLogger(__name__)


async def take_step_failure(watch: Watch, record: MissionRecord, event: DroneEvent) -> None:
    """The drone will not do this step: it waits for another plan where it stands.

    That may be elsewhere than planned, when a failsafe led it there; without a station it is down
    in the open, and flies no more. Packages that nobody was there to take go elsewhere from now on.
    """
    step = await end_step(watch.tx, record.mission_id, event, status="FAILED")
    record = begun(watch, record, at=event.started_at or event.ended_at)
    code, detail = event.code or "STEP_FAILED", _in_words(event, step)
    if event.station_id is None:
        await take_forced_landing(
            watch,
            record,
            at=event.ended_at,
            position=event.position,
            soc=event.soc,
            code=code,
            detail=detail,
        )
        return
    if code == "RECIPIENT_ABSENT":
        record = _without_recipient(watch, record, step, detail=detail)
    elif code == UNKNOWN:
        record, detail = await take_unknown_hand_over(watch, record, step, event)
    stuck = Stuck(
        code=code,
        detail=detail,
        station_id=event.station_id,
        soc=event.soc,
        last_step=event.step_id or 0,
        occupied=occupied_pad(step, event) if code == Fault.PAD_OCCUPIED else None,
    )
    await _keep_stuck(watch, record, stuck)


async def wait_for_revision(
    watch: Watch, record: MissionRecord, *, code: str, detail: str, last_step: int = 0
) -> None:
    """Note that the drone stands and waits; `recompose` finds it, from where its state says."""
    state = watch.links[record.drone_id].state
    if state is not None and state.activity == "DOWN":
        await take_forced_landing(
            watch,
            record,
            at=state.at,
            position=state.position,
            soc=state.soc,
            code=code,
            detail=detail,
        )
        return
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
    await _keep_stuck(watch, record, stuck)


async def _keep_stuck(watch: Watch, record: MissionRecord, stuck: Stuck) -> None:
    """Keep why the drone waits, and say that another plan is looked for unless that was said."""
    if record.stuck is None and record.trouble is None:
        record = report(
            watch,
            record,
            "REPLANNING",
            at=watch.clock.now(),
            code=stuck.code,
            detail=stuck.detail,
            station_id=stuck.station_id,
        )
    await watch.keep(replace(record, stuck=stuck))
    await store.plan_at_once(watch.tx, record.mission_id)


def _in_words(event: DroneEvent, step: FlightStep | None) -> str:
    """Why the step failed, and where that has left the drone if not at the step's end."""
    match step:
        case DeliverStep() if event.code == "RECIPIENT_ABSENT" and event.detail is None:
            packages = ", ".join(step.package_ids)
            wait_s = step.recipient_wait_s
            return f"nobody took {packages} at {step.station_id!r} within {wait_s:g} s"
        case FlyStep() if event.station_id not in (None, step.from_id, step.to_id):
            where = f"landed at {event.station_id!r} instead of {step.to_id!r}"
            return f"the drone {where}: {event.detail or event.code}"
        case FlyStep() if event.station_id == step.from_id and event.energy_j > 0:
            where = f"went back to {event.station_id!r} on its way to {step.to_id!r}"
            return f"the drone {where}: {event.detail or event.code}"
        case _:
            return event.detail or "a step failed"


def _without_recipient(
    watch: Watch, record: MissionRecord, step: FlightStep | None, *, detail: str
) -> MissionRecord:
    """The record with other aims for what could not be handed over."""
    if not isinstance(step, DeliverStep):
        return record
    changed = [
        absent_aim(record, package) for package in record.packages(frozenset(step.package_ids))
    ]
    return with_aims(
        watch, record, aimed(record.aims, changed), code="RECIPIENT_ABSENT", detail=detail
    )
