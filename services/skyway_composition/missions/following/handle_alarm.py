"""Handles the alarms of drones: an operator looks at each, as long as they are not too many."""

import logging

from skyway.contracts.drone_report import DroneEvent
from skyway.runtime.metrics import count
from skyway.units import moment_to_ms
from skyway_composition.alarm_store import add as raise_alarm
from skyway_composition.alarm_store import has_room
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork

log = logging.getLogger(__name__)


async def handle_alarm(work: MissionUnitOfWork, link: DroneLink, event: DroneEvent) -> None:
    """Raise the alarm of a drone, unless too many of its alarms are open."""
    log.warning("alarm", extra={"drone_id": link.drone_id, "code": event.code})
    level = event.level or "WARNING"
    if not await has_room(work.tx.connection, link.drone_id, level):
        count("skyway_alarms_left_out", "alarms of drones that have too many open ones")
        return
    await raise_alarm(
        work.tx,
        level=level,
        code=event.code or "ALARM",
        detail=event.detail or "the drone raised an alarm",
        at_ms=moment_to_ms(event.ended_at),
        mint=work.mint,
        provider_id=link.provider_id,
        drone_id=link.drone_id,
        mission_id=event.mission_id,
        station_id=event.station_id,
        data=event.data,
    )
