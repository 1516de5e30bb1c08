"""Sends waiting messages to the servers of composition, past the servers that do not answer."""

from collections.abc import Awaitable, Callable

from skyway.ids import NetworkId
from skyway.runtime.errors import ServiceUnavailable

#: The networks whose servers do not answer, each with the error.
Silent = dict[NetworkId, ServiceUnavailable]


async def send_past_silent(send: Callable[[Silent], Awaitable[int]], *, most: int) -> bool:
    """Send messages for several servers; messages for a silent server keep back no others.

    `send` looks for at most `most` messages whose network is not in the dictionary, and sends them.
    It adds each network whose server does not answer, and returns how many messages it found. The
    result is whether there may be more messages.

    Raises
    ------
    ServiceUnavailable
        A server does not answer; the messages for its networks wait.
    """
    silent: Silent = {}
    while True:
        before = len(silent)
        found = await send(silent)
        if found < most or len(silent) == before:
            break  # else there may be other messages behind those for a silent server
    for first in silent.values():
        raise first
    return found == most
