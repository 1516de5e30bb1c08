"""Sends a QUEUED mission to its drone, and instructs a drone to end its standby early."""

from dataclasses import replace

from skyway.contracts.flight_step import FlightStep, FlyStep
from skyway.ids import StationId
from skyway.units import ms_to_moment
from skyway_composition.links.instruction_store import last_revision
from skyway_composition.missions.mission.from_trip import finished_wait
from skyway_composition.missions.mission.instruct import send_mission
from skyway_composition.missions.mission.record import (
    NEXT_MISSION,
    MissionRecord,
    Trouble,
    moved,
)
from skyway_composition.missions.mission.standby import shortened_mission, shortened_steps
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.outlook.situation import Situation, whereabouts
from skyway_composition.missions.replanning.propose import Revision, propose
from skyway_composition.missions.replanning.remainder.anchor import Anchor


async def send_next(work: MissionUnitOfWork, record: MissionRecord) -> None:
    """Send a QUEUED mission to its drone, which has no other mission now."""
    await send_mission(work, replace(moved(record, "BOOKED"), planned_in=None))


async def shorten_standby(work: MissionUnitOfWork, record: MissionRecord, *, until_ms: int) -> None:
    """Propose that the drone ends its standby at this moment, where its next mission begins.

    Nothing is sent when the drone has left that stay already; its next landing is found then.
    """
    situation = await Situation.of(work, record)
    changed = shortened_steps(situation.planned, until_ms=until_ms)
    where = whereabouts(situation)
    if changed is None or where is None:
        return
    first_step, steps = changed
    is_under_way = first_step <= where.released_through
    if first_step < where.next_step or (is_under_way and not steps):
        return
    before = [each for each in situation.planned if each.step_id < first_step]
    station_id = _end_of(before[-1]) if before else where.station_id
    if station_id is None:
        return
    if not steps:
        steps = (finished_wait(station_id, until_ms, step_id=first_step),)
    sent = max(record.mission.revision, await last_revision(work.tx, record.mission_id))
    mission = shortened_mission(record.mission, served_ms=record.served_ms, until_ms=until_ms)
    revision = Revision(mission.model_copy(update={"revision": sent + 1}), steps, record.aims)
    anchor = Anchor(
        station_id=station_id,
        at_ms=until_ms,
        soc=where.soc,
        last_valid_step=first_step - 1,
        carried=situation.carried,
        has_loaded=situation.has_loaded,
        is_divert=is_under_way,
    )
    detail = f"the drone's next mission begins at {ms_to_moment(until_ms).isoformat()}"
    trouble = Trouble(code=NEXT_MISSION, detail=detail)
    await propose(work, record, revision, anchor=anchor, trouble=trouble)


def _end_of(step: FlightStep) -> StationId:
    return step.to_id if isinstance(step, FlyStep) else step.station_id
