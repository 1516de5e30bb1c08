"""A revision for a drone that stands and waits: nothing of the old plan is left to hold."""

from dataclasses import replace

from skyway_composition.missions.dispatch import dispatch
from skyway_composition.missions.give_back import give_back
from skyway_composition.missions.record import MissionRecord, Trouble
from skyway_composition.missions.revisions.proposal import Revision
from skyway_composition.missions.revisions.telling import told_replanned, with_aims
from skyway_composition.missions.steps.store import replace_planned
from skyway_composition.missions.watch import Watch


async def replace_plan(
    watch: Watch, record: MissionRecord, revision: Revision, *, trouble: Trouble
) -> None:
    """Put a revision in the place of all that was planned, and send it.

    Raises
    ------
    Taken
        Somebody else holds one of the new pads.
    """
    mission = revision.mission
    await replace_planned(watch.tx, record.mission_id, revision.steps, revision=mission.revision)
    record = with_aims(watch, record, revision.aims, code=trouble.code, detail=trouble.detail)
    record = replace(record, mission=mission, stuck=None, trouble=None, told=None)
    await give_back(watch, record)
    watch.links[record.drone_id] = await dispatch(
        watch.tx,
        watch.courier,
        watch.links[record.drone_id],
        mission=mission,
        steps=revision.steps,
        expires_at=watch.courier.expiry(),
    )
    record = told_replanned(watch, record, code=trouble.code, detail=trouble.detail)
    await watch.keep(record)
