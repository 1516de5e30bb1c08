"""Steps of a start that are tried again, because their cause may pass by itself."""

import math
from collections.abc import Awaitable, Callable
from typing import Final, TypeVar

from skyway.errors import SkywayError
from skyway.runtime.clock import AnchoredClock, FleetClock, sleep_wall

T = TypeVar("T")

#: Seconds of wall time between two tries: doubled from the first to the last.
_FIRST_PAUSE_S: Final = 0.25
_LONGEST_PAUSE_S: Final = 2.0


class NotNow(SkywayError):
    """A step of the start cannot be done now; the message says why."""


async def until_done(
    step: Callable[[], Awaitable[T]],
    *,
    say: Callable[[str], None],
    within_s: float = math.inf,
    clock: FleetClock | None = None,
) -> T:
    """The result of a step that is tried again while it raises `NotNow`.

    `say` gets each cause once.

    Raises
    ------
    NotNow
        The step still could not be done after `within_s` of wall time.
    """
    clock = clock or AnchoredClock.plain()
    began_at, pause_s, said = clock.wall_now(), _FIRST_PAUSE_S, ""
    while True:
        try:
            return await step()
        except NotNow as cause:
            if (clock.wall_now() - began_at).total_seconds() >= within_s:
                raise
            if str(cause) != said:
                said = str(cause)
                say(f"{said}. Trying again.")
        await sleep_wall(clock, pause_s)
        pause_s = min(2 * pause_s, _LONGEST_PAUSE_S)
