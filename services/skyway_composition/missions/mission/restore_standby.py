"""Gives a drone a standby again, after the mission for which it had ended early is gone.

Without it, the drone would end its last mission with little charge, and stay there.
"""

from typing import Final

from skyway.ids import DroneId
from skyway.units import CHARGE_TOLERANCE, moment_to_ms
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
from skyway_composition.planning.availability import send_ahead_ms

#: A mission that can begin this much sooner is planned again, fleet milliseconds. Our own choice.
WORTH_MS: Final = 60_000


async def restore_standby(work: MissionUnitOfWork, left: MissionRecord) -> None:
    """Request a plan with a standby for the mission before one that has left the calendar."""
    if await queued_of_drone(work.tx.connection, left.drone_id):
        await plan_queue_again(work.tx, left.drone_id)
        return
    live = work.missions.get(left.drone_id)
    if live is None or live.trouble is not None or live.stuck is not None or not live.stays:
        return
    if _has_ended_early(live):
        detail = "the next mission has left the drone's calendar"
        await work.save(live.with_trouble(Trouble(code=STANDBY_ENDED, detail=detail)))


async def begin_sooner(work: MissionUnitOfWork, drone_id: DroneId) -> None:
    """Have a drone's QUEUED missions planned again if the next one may begin sooner than planned.

    Nobody looks at an idle drone until its next mission is near.
    """
    first = next(iter(await queued_of_drone(work.tx.connection, drone_id)), None)
    if first is None:
        return
    near_ms = moment_to_ms(work.clock.now()) + send_ahead_ms(work.clock)
    if first.start.at_ms > max(near_ms, first.earliest_ms + WORTH_MS):
        await plan_queue_again(work.tx, drone_id)


def _has_ended_early(live: MissionRecord) -> bool:
    """Whether the drone's standby is left out or cut short, now or by the plan on its way."""
    is_proposed = live.proposal is not None and live.proposal.code == NEXT_MISSION
    if is_proposed or moment_to_ms(live.mission.released_at) <= live.served_ms:
        return True
    last, drone = live.stays[-1], live.candidate
    is_away = drone.standby == "HOME" and last.station_id != drone.home_station_id
    return is_away or last.soc_from < drone.model.top_soc - CHARGE_TOLERANCE
