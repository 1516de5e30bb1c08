"""A flight of a real autopilot up to its landing: upload, arm, start, and follow."""

from collections.abc import Sequence
from typing import Final

from skyway.contracts.flight_step import FlyStep
from skyway.runtime.clock import sleep_wall
from skyway_drone_agent.mavlink.autopilot import Autopilot
from skyway_drone_agent.mavlink.link import MavlinkLink, command
from skyway_drone_agent.mavlink.mission import FlightPlan, MissionRefused, flight_plan, upload

#: ArduCopter's number of the mode in which it may be armed for a mission.
_COPTER_GUIDED: Final = 4

#: Wall seconds between two tries of a command that the autopilot refuses for now, and the number of
#: tries on the ground.
_AGAIN_S: Final = 2.0
_TRIES: Final = 5

#: Wall seconds until an accepted command shows its effect, and until the drone has left the ground,
#: because some motors start slowly.
_EFFECT_S: Final = 10.0
_RISE_S: Final = 60.0


class FlightRefused(MissionRefused):
    """The autopilot does not take off."""


class MavlinkFlight:
    """Flights that the autopilot has as one mission, in their order; the last flight lands."""

    def __init__(
        self, autopilot: Autopilot, route: Sequence[FlyStep], *, ends: Sequence[int]
    ) -> None:
        self._autopilot = autopilot
        self._route = tuple(route)
        self._ends = tuple(ends)

    def goes_on_with(self, route: Sequence[FlyStep]) -> bool:
        """Whether these flights are the remaining flights of the autopilot's mission."""
        return self._route[-len(route) :] == tuple(route)

    async def end_of(self, step: FlyStep) -> None:
        """Return when the drone is at the end of this step: over it, or on the ground."""
        if step.lands:
            await self._autopilot.until(self._has_landed)
        else:
            end = self._ends[self._route.index(step)]
            await self._autopilot.until(lambda: self._is_past(end))

    def _is_past(self, item: int) -> bool:
        autopilot = self._autopilot
        is_beyond = autopilot.item_now is not None and autopilot.item_now > item
        return autopilot.item_reached >= item or is_beyond or self._has_landed()

    def _has_landed(self) -> bool:
        return self._autopilot.is_on_ground and not self._autopilot.is_armed


async def begin_flight(
    link: MavlinkLink,
    autopilot: Autopilot,
    route: Sequence[FlyStep],
    *,
    altitude_m: float,
    speed_mps: float,
) -> MavlinkFlight:
    """Make the autopilot fly this route, and return once the drone is in the air.

    A drone that is in the air already turns to this route immediately.

    Raises
    ------
    MissionRefused
        The autopilot refuses the mission, or does not take off.
    """
    is_airborne = not autopilot.is_on_ground
    plan = flight_plan(
        route,
        dialect=link.dialect,
        start=autopilot.position or route[0].from_position,
        is_airborne=is_airborne,
        has_home_item=autopilot.is_ardupilot,
        altitude_m=altitude_m,
        speed_mps=speed_mps,
    )
    await upload(link, plan.items)
    autopilot.forget_mission()
    if is_airborne:
        await _start(link, autopilot, plan)
    else:
        await _arm(link, autopilot)
        await _start(link, autopilot, plan)
        await _rise(autopilot)
    return MavlinkFlight(autopilot, route, ends=plan.ends)


async def _arm(link: MavlinkLink, autopilot: Autopilot) -> None:
    dialect = link.dialect
    if autopilot.is_ardupilot:
        custom = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        await command(link, dialect.MAV_CMD_DO_SET_MODE, custom, _COPTER_GUIDED)
    await _insist(link, "arm", dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    if not await autopilot.until(lambda: autopilot.is_armed, timeout_s=_EFFECT_S):
        raise FlightRefused("the autopilot does not arm")


async def _start(link: MavlinkLink, autopilot: Autopilot, plan: FlightPlan) -> None:
    """Start at the first item: an autopilot in the air may be at any other item."""
    target = await link.target()
    for _ in range(_TRIES):
        link.mav.mission_set_current_send(*target, plan.first)
        if await autopilot.until(lambda: autopilot.item_now is not None, timeout_s=_AGAIN_S):
            break
    # Without first and last item: ArduPilot denies the command if they are not 0.
    await _insist(link, "start", link.dialect.MAV_CMD_MISSION_START)


async def _rise(autopilot: Autopilot) -> None:
    """Return once the drone is in the air; an autopilot that does not rise disarms itself."""
    await autopilot.until(
        lambda: not autopilot.is_on_ground or not autopilot.is_armed, timeout_s=_RISE_S
    )
    if autopilot.is_on_ground:
        raise FlightRefused("the autopilot does not take off")


async def _insist(link: MavlinkLink, what: str, command_id: int, *params: float) -> None:
    """Repeat a command, which may be refused for now, until it is accepted."""
    dialect = link.dialect
    result: int | None = None
    for _ in range(_TRIES):
        result = await command(link, command_id, *params)
        if result == dialect.MAV_RESULT_ACCEPTED:
            return
        if result not in (None, dialect.MAV_RESULT_TEMPORARILY_REJECTED):
            break
        await sleep_wall(link.clock, _AGAIN_S)
    name = "nothing" if result is None else dialect.enums["MAV_RESULT"][result].name
    raise FlightRefused(f"the autopilot answers {name} when asked to {what}")
