"""Checks the plan of a mission after each new event or state."""

from datetime import datetime
from typing import Final

from skyway.contracts.drone_report import DroneEvent, DroneState
from skyway.runtime.clock import fleet_margin
from skyway.units import moment_to_ms
from skyway_composition.missions.mission.notify import report
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.outlook.deviation import (
    LEAST_SHORTFALL_SOC,
    REPORTED_LATENESS,
    Outlook,
    outlook,
)
from skyway_composition.missions.replanning.outlook.situation import Situation, waits_for_pad
from skyway_composition.missions.replanning.request_plan import request_plan
from skyway_composition.planning.problem_for import used_more
from skyway_composition.planning.world import ClosedAhead

#: Longest time until a drone's report arrives, for `fleet_margin`. Our own choice.
REPORT_DELAY: Final = {"fleet_s": 30.0, "wall_s": 2.0}


async def check_plan(
    work: MissionUnitOfWork, record: MissionRecord, closed: ClosedAhead | None = None
) -> MissionRecord:
    """Request another plan if the present one leads to trouble; returns the saved record.

    Plans avoid what is `closed`; only a late drone may meet it.
    """
    seen = await _outlook(work, record, closed)
    if seen is None or seen.trouble is None:
        return record
    return await request_plan(work, record, seen.trouble)


async def check_plan_after_step(
    work: MissionUnitOfWork, record: MissionRecord, event: DroneEvent
) -> MissionRecord:
    """Check the plan after a step has ended; without trouble, report a delay to the customer."""
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
    """The trouble with its cause, if the event has just reported the cause."""
    if event.code != "SHORT_CHARGE" or trouble.code != "MORE_ENERGY":
        return trouble
    detail = f"charged to {event.soc:.3f} only before the session at {event.station_id!r} ended"
    return Trouble(code="SHORT_CHARGE", detail=f"{detail}: {trouble.detail}")


async def _outlook(
    work: MissionUnitOfWork, record: MissionRecord, closed: ClosedAhead | None = None
) -> Outlook | None:
    """What to expect of the plan.

    None if another plan is needed already, if the mission is held, in doubt or waits, or without a
    report.
    """
    mission = record.mission
    needs_no_check = record.trouble or record.stuck or record.proposal or mission.is_held
    if waits_for_pad(record, work.links[record.drone_id]):
        # The drone itself requests another plan. A plan with the same pad would make it wait again.
        return None
    # The time that a loader takes is not planned: the plan is made again after the confirmation.
    is_waiting = mission.state == "BOOKED" or mission.loading == "AWAITED"
    # Nobody knows what a drone in doubt does: to say that its mission is replanned would be false.
    if needs_no_check or is_waiting or mission.doubt is not None or not record.is_live:
        return None
    if _is_as_booked(record, work.links[record.drone_id].state, now=work.clock.now()):
        return None
    situation = await Situation.of(work, record)
    # Reports about the last seconds may be on their way: the drone may be further than reported.
    reported_until = work.clock.now() - fleet_margin(work.clock, **REPORT_DELAY)
    return outlook(situation, now_ms=moment_to_ms(reported_until), closed=closed)


def _is_as_booked(record: MissionRecord, state: DroneState | None, *, now: datetime) -> bool:
    """Whether a drone stands ready as when its first plan was made, so that the plan holds."""
    mission, drone = record.mission, record.candidate
    is_to_begin = (mission.state, mission.revision) == ("ACCEPTED", 1) and now <= mission.start_at
    # A loader's confirmation or a cancellation changes what the drone was booked for.
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
