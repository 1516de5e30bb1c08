"""Comparing a mission with its plan whenever something new is known of it."""

from datetime import datetime
from typing import Final

from skyway.contracts.drone_report import DroneEvent, DroneState
from skyway.runtime.clock import fleet_margin
from skyway.units import moment_to_ms
from skyway_composition.missions.mission.notify import report
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.failsafes import waits_for_pad
from skyway_composition.missions.replanning.outlook.deviation import (
    LEAST_SHORTFALL_SOC,
    REPORTED_LATENESS,
    Closed,
    Outlook,
    outlook,
)
from skyway_composition.missions.replanning.outlook.situation import Situation
from skyway_composition.missions.replanning.request_plan import request_plan
from skyway_composition.planning.problem_for import used_more

#: Longest time from what a drone does until it is heard here; `fleet_margin` of it. Our own choice.
REPORT_DELAY: Final = {"fleet_s": 30.0, "wall_s": 2.0}


async def check_plan(
    work: MissionUnitOfWork, record: MissionRecord, closed: Closed | None = None
) -> MissionRecord:
    """The record with its trouble, if the plan leads to one; it is kept already.

    Only a drone that is late may meet what is `closed`: its plan keeps clear of it.
    """
    seen = await _outlook(work, record, closed)
    if seen is None or seen.trouble is None:
        return record
    return await request_plan(work, record, seen.trouble)


async def check_plan_after_step(
    work: MissionUnitOfWork, record: MissionRecord, event: DroneEvent
) -> MissionRecord:
    """The same after a step has ended; where nothing is lost, the customer hears of a delay."""
    seen = await _outlook(work, record)
    if seen is None:
        return record
    if seen.trouble is not None:
        return await request_plan(work, record, _explained(seen.trouble, event))
    if seen.late_by < REPORTED_LATENESS:
        return record
    record = report(
        work,
        record,
        "ACTIVITY",
        at=event.ended_at,
        station_id=event.station_id,
        soc=event.soc,
        etas=seen.etas,
        data={"late_by_s": seen.late_by.total_seconds()},
    )
    await work.save(record)
    return record


def _explained(trouble: Trouble, event: DroneEvent) -> Trouble:
    """The trouble by its cause, where that has just been told."""
    if event.code != "SHORT_CHARGE" or trouble.code != "MORE_ENERGY":
        return trouble
    detail = f"charged to {event.soc:.3f} only before the session at {event.station_id!r} ended"
    return Trouble(code="SHORT_CHARGE", detail=f"{detail}: {trouble.detail}")


async def _outlook(
    work: MissionUnitOfWork, record: MissionRecord, closed: Closed | None = None
) -> Outlook | None:
    """What to expect; None where another plan is looked for already, or nothing is to go on."""
    needs_no_check = record.trouble or record.stuck or record.proposal or record.mission.is_held
    if waits_for_pad(record, work.links[record.drone_id]):
        # It asks for another plan by itself: one with the same pad would have it wait anew.
        return None
    # How long a loader takes is nobody's plan: it is made anew once the packages are confirmed.
    is_waiting = record.mission.state == "BOOKED" or record.mission.loading == "AWAITED"
    if needs_no_check or is_waiting or not record.is_live:
        return None
    if _is_as_booked(record, work.links[record.drone_id].state, now=work.clock.now()):
        return None
    situation = await Situation.of(work, record)
    # What a drone has done of late may not have been heard yet: it may be further than we know.
    known_until = work.clock.now() - fleet_margin(work.clock, **REPORT_DELAY)
    return outlook(situation, now_ms=moment_to_ms(known_until), closed=closed)


def _is_as_booked(record: MissionRecord, state: DroneState | None, *, now: datetime) -> bool:
    """Whether a drone stands ready as it did when its plan was checked, so that the plan holds."""
    mission, drone = record.mission, record.candidate
    is_to_begin = (mission.state, mission.revision) == ("ACCEPTED", 1) and now <= mission.start_at
    # What loaders say of its load, or people of its packages, changes what it is booked for.
    is_changed = mission.loading != "AUTOMATIC" or record.aims
    if state is None or state.mission_id != mission.mission_id or not is_to_begin or is_changed:
        return False
    factor = 1.0 if state.health is None else state.health.consumption_factor
    return (
        (state.activity, state.station_id) == ("IDLE", drone.station_id)
        and state.at <= mission.start_at
        and state.soc >= drone.soc - LEAST_SHORTFALL_SOC
        and used_more(factor) <= mission.margins.energy_margin
    )
