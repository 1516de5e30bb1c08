"""Handles the alarms of drones: an operator looks at each, as long as they are not too many."""

import logging
from typing import Final

from skyway.contracts.drone_report import DroneEvent, Fault
from skyway.runtime.metrics import count
from skyway.runtime.mqtt.moments import earliest_believed
from skyway.units import moment_to_ms
from skyway_composition.alarm_store import add as raise_alarm
from skyway_composition.alarm_store import has_room
from skyway_composition.links.link import DroneLink
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork

log = logging.getLogger(__name__)

#: The request of a drone for another plan.
PLAN_REQUEST: Final = "PLAN_WANTED"

#: The codes that a drone may use. All others are ours: an open alarm of ours is raised only once,
#: so a drone that raised it first would hide it.
_CODES_OF_DRONES: Final = frozenset((*Fault, PLAN_REQUEST))
_OTHER: Final = "ALARM"


async def handle_alarm(work: MissionUnitOfWork, link: DroneLink, event: DroneEvent) -> None:
    """Raise the alarm of a drone, unless too many of it or of its provider's drones are open."""
    log.warning("alarm", extra={"drone_id": link.drone_id, "code": event.code})
    level = event.level or "WARNING"
    code, detail = _in_our_words(event)
    if not await has_room(work.tx.connection, link.provider_id, link.drone_id, level):
        count("skyway_alarms_left_out", "alarms of drones that have too many open ones")
        return
    await raise_alarm(
        work.tx,
        level=level,
        code=code,
        detail=detail,
        # A drone that was away sends its alarms when it is connected again.
        at_ms=moment_to_ms(max(event.ended_at, earliest_believed(work.clock))),
        mint=work.mint,
        provider_id=link.provider_id,
        drone_id=link.drone_id,
        mission_id=event.mission_id,
        station_id=event.station_id,
        data=event.data,
    )


def _in_our_words(event: DroneEvent) -> tuple[str, str]:
    """Code and detail of the alarm; a code that no drone may use goes into the detail."""
    detail = event.detail or "the drone raised an alarm"
    if event.code is None or event.code in _CODES_OF_DRONES:
        return event.code or _OTHER, detail
    return _OTHER, f"{event.code}: {detail}"
