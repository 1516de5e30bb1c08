"""MAVLink's mission protocol: flights as mission items, and their upload to the autopilot."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from skyway.contracts.flight_step import FlyStep
from skyway.errors import SkywayError
from skyway.geo import Position
from skyway_drone_agent.mavlink.fields import MavlinkMessage
from skyway_drone_agent.mavlink.link import MavlinkLink, MessageQueue

log = logging.getLogger(__name__)

#: Wall seconds before an unanswered message is sent again, and how often: the protocol's values.
_TIMEOUT_S: Final = 1.5
_TIMES: Final = 5

#: How often an upload begins anew after the autopilot has lost track of it.
_UPLOADS: Final = 3

#: MAV_CMD_DO_CHANGE_SPEED: the speed over ground, and no change of the throttle.
_GROUND_SPEED, _SAME_THROTTLE = 1.0, -1.0

#: Places in MISSION_ITEM_INT are whole numbers: so many make a degree.
_PER_DEGREE: Final = 1e7


class MissionRefused(SkywayError):
    """The autopilot does not accept the mission."""


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One item; places are above the take-off's altitude."""

    command: int
    place: Position | None = None
    altitude_m: float = 0.0
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0


@dataclass(frozen=True, slots=True)
class FlightPlan:
    """The items of flights up to a landing; `first` is flown first, `ends` end each flight."""

    items: tuple[MissionItem, ...]
    first: int
    ends: tuple[int, ...]


def flight_plan(
    route: Sequence[FlyStep],
    *,
    dialect: Any,  # pymavlink's numbers
    start: Position,
    is_airborne: bool,
    has_home_item: bool,
    altitude_m: float,
    speed_mps: float,
) -> FlightPlan:
    """The mission that flies these steps and lands at the end of the last.

    ArduPilot keeps its home in item 0 (`has_home_item`), so the flight begins with item 1.
    """
    items: list[MissionItem] = []
    if has_home_item:
        items.append(MissionItem(dialect.MAV_CMD_NAV_WAYPOINT, start))
    first = len(items)
    if not is_airborne:
        items.append(MissionItem(dialect.MAV_CMD_NAV_TAKEOFF, start, altitude_m))
    items.append(
        MissionItem(
            dialect.MAV_CMD_DO_CHANGE_SPEED,
            param1=_GROUND_SPEED,
            param2=speed_mps,
            param3=_SAME_THROTTLE,
        )
    )
    ends: list[int] = []
    for step in route:
        items.append(MissionItem(dialect.MAV_CMD_NAV_WAYPOINT, step.to_position, altitude_m))
        if step.lands:
            items.append(MissionItem(dialect.MAV_CMD_NAV_LAND, step.to_position))
        ends.append(len(items) - 1)
    return FlightPlan(tuple(items), first, tuple(ends))


async def upload(link: MavlinkLink, items: Sequence[MissionItem]) -> None:
    """Give the autopilot these items in place of those that it has.

    Raises
    ------
    MissionRefused
        The autopilot refuses an item, or does not answer.
    """
    lost_track = {
        link.dialect.MAV_MISSION_INVALID_SEQUENCE,
        link.dialect.MAV_MISSION_OPERATION_CANCELLED,
        None,
    }
    result: int | None = None
    for _ in range(_UPLOADS):
        result = await _uploaded(link, items)
        if result == link.dialect.MAV_MISSION_ACCEPTED:
            return
        if result not in lost_track:
            break
    if result is None:
        raise MissionRefused("the autopilot does not answer")
    name = link.dialect.enums["MAV_MISSION_RESULT"][result].name
    raise MissionRefused(f"the autopilot answers {name} to a mission of {len(items)} items")


async def _uploaded(link: MavlinkLink, items: Sequence[MissionItem]) -> int | None:
    """The MAV_MISSION_RESULT of one upload; None if the autopilot stopped answering."""
    target = await link.target()
    asked_for: int | None = None
    with link.receiving("MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK") as answers:
        for _ in range(_TIMES):
            if asked_for is None:
                link.mav.mission_count_send(*target, len(items))
            else:
                _send_item(link, target, items, asked_for)
            while (message := await _next(answers)) is not None:
                if message.get_type() == "MISSION_ACK":
                    return int(message.type)
                if message.seq >= len(items):
                    continue
                # Items are sent only on request, as often as they are requested.
                asked_for = message.seq
                _send_item(link, target, items, asked_for)
    return None


async def _next(answers: MessageQueue) -> MavlinkMessage | None:
    """The next message about a mission, not about fences or rally points."""
    while (message := await answers.next(_TIMEOUT_S)) is not None:
        if getattr(message, "mission_type", 0) == 0:
            return message
    return None


def _send_item(
    link: MavlinkLink, target: tuple[int, int], items: Sequence[MissionItem], seq: int
) -> None:
    item = items[seq]
    place = item.place or Position(0.0, 0.0)
    link.mav.mission_item_int_send(
        *target,
        seq,
        link.dialect.MAV_FRAME_MISSION
        if item.place is None
        else link.dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        item.command,
        0,
        1,  # go on by itself
        item.param1,
        item.param2,
        item.param3,
        0.0,
        round(place.latitude_deg * _PER_DEGREE),
        round(place.longitude_deg * _PER_DEGREE),
        item.altitude_m,
    )
