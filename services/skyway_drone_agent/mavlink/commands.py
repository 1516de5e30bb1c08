"""MAVLink's commands: sent until they are answered, or only once where twice would be wrong."""

from typing import Final

from skyway_drone_agent.mavlink.link import MavlinkLink

#: Wall seconds before a command that was not answered is sent again, and how often it is sent.
_TIMEOUT_S: Final = 1.5
_TIMES: Final = 5

#: Wall seconds that an answer may take once the autopilot says that it is at work.
_AT_WORK_S: Final = 30.0


async def command(link: MavlinkLink, command_id: int, *params: float) -> int | None:
    """The autopilot's MAV_RESULT for a command that may be sent again; None without an answer."""
    for confirmation in range(_TIMES):
        result = await _sent(
            link, command_id, params, confirmation=confirmation, timeout_s=_TIMEOUT_S
        )
        if result is not None:
            return result
    return None


async def command_once(
    link: MavlinkLink, command_id: int, *params: float, timeout_s: float
) -> int | None:
    """The MAV_RESULT of a command that must not be done twice; None: nobody knows."""
    return await _sent(link, command_id, params, confirmation=0, timeout_s=timeout_s)


async def _sent(
    link: MavlinkLink,
    command_id: int,
    params: tuple[float, ...],
    *,
    confirmation: int,
    timeout_s: float,
) -> int | None:
    target = await link.target_known()
    seven = (*params, *[0.0] * 7)[:7]
    with link.hearing("COMMAND_ACK") as heard:
        link.mav.command_long_send(*target, command_id, confirmation, *seven)
        while (answer := await heard.next(timeout_s)) is not None:
            if answer.command != command_id:
                continue
            if answer.result != link.dialect.MAV_RESULT_IN_PROGRESS:
                return int(answer.result)
            timeout_s = _AT_WORK_S
    return None
