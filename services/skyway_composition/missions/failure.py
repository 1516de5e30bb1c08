"""A drone that stands and waits: a step failed, it refused a revision, it lost its journal."""

import logging
from dataclasses import replace

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import DeliverStep, FlightStep
from skyway_composition.missions import store
from skyway_composition.missions.aiming import absent_aim, aimed
from skyway_composition.missions.beginning import begun
from skyway_composition.missions.proposal import with_aims
from skyway_composition.missions.record import MissionRecord, Stuck
from skyway_composition.missions.report import report
from skyway_composition.missions.watch import Watch

log = logging.getLogger(__name__)


async def take_step_failure(watch: Watch, record: MissionRecord, event: DroneEvent) -> None:
    """The drone will not do this step: it waits for another plan where it stands.

    Packages that nobody was there to take go elsewhere from now on.
    """
    step = await store.end_step(watch.tx, record.mission_id, event, status="FAILED")
    record = begun(watch, record, at=event.started_at or event.ended_at)
    code, detail = event.code or "STEP_FAILED", event.detail or _in_words(event, step)
    if code == "RECIPIENT_ABSENT":
        record = _without_recipient(watch, record, step, detail=detail)
    last_step = event.step_id or 0
    if event.station_id is None:
        await watch.keep(record)
        await wait_for_revision(watch, record, code=code, detail=detail, last_step=last_step)
        return
    stuck = Stuck(
        code=code, detail=detail, station_id=event.station_id, soc=event.soc, last_step=last_step
    )
    await _keep_stuck(watch, record, stuck)


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
    await _keep_stuck(watch, record, stuck)


async def _keep_stuck(watch: Watch, record: MissionRecord, stuck: Stuck) -> None:
    """Keep why the drone waits, and say that another plan is looked for unless that was said."""
    if record.stuck is None and record.trouble is None:
        record = report(
            watch.tx,
            record,
            "REPLANNING",
            at=watch.clock.now(),
            mint=watch.mint,
            code=stuck.code,
            detail=stuck.detail,
            station_id=stuck.station_id,
        )
    await watch.keep(replace(record, stuck=stuck))
    await store.plan_at_once(watch.tx, record.mission_id)


def _in_words(event: DroneEvent, step: FlightStep | None) -> str:
    if event.code != "RECIPIENT_ABSENT" or not isinstance(step, DeliverStep):
        return "a step failed"
    packages = ", ".join(step.package_ids)
    return f"nobody took {packages} at {step.station_id!r} within {step.recipient_wait_s:g} s"


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
