"""Gives a drone a standby again, after the mission for which it had ended early is gone.

Without it, the drone would end its last mission with little charge, and stay there.
"""

from skyway.units import moment_to_ms
from skyway_composition.missions.mission.queued_store import (
    plan_queue_again,
    queued_of_drone,
)
from skyway_composition.missions.mission.record import (
    NEXT_MISSION,
    STANDBY_ENDED,
    MissionRecord,
    Trouble,
)
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork


async def restore_standby(work: MissionUnitOfWork, left: MissionRecord) -> None:
    """Request a plan with a standby for the mission before one that has left the calendar."""
    if await queued_of_drone(work.tx.connection, left.drone_id):
        await plan_queue_again(work.tx, left.drone_id)
        return
    live = work.missions.get(left.drone_id)
    if live is None or live.trouble is not None or live.stuck is not None:
        return
    if _has_ended_early(live):
        detail = "the next mission has left the drone's calendar"
        await work.save(live.with_trouble(Trouble(code=STANDBY_ENDED, detail=detail)))


def _has_ended_early(live: MissionRecord) -> bool:
    """Whether the drone has no standby after its last hand-over, now or by the plan on its way."""
    is_proposed = live.proposal is not None and live.proposal.code == NEXT_MISSION
    return is_proposed or moment_to_ms(live.mission.released_at) <= live.served_ms
