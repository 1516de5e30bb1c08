"""Wait until another process has done something, by asking again and again."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Any

#: Longest wait, in seconds of wall time; generous, because CI machines can be slow.
LONGEST_WAIT_S = 300.0
#: For a program that starts a system, plays a story of many steps, and ends.
LONGEST_PROGRAM_S = 900.0

#: The pause before the second question, and how pauses grow: many questions keep a system busy.
_FIRST_PAUSE_S, _LONGEST_PAUSE_S, _GROWTH = 0.05, 0.25, 1.2


def eventually(
    condition: Callable[[], Any], what: str, *, instead: Callable[[], object] | None = None
) -> Any:
    """The first true value of a condition on other processes.

    `instead` returns the present situation, for the message of a test that fails.
    """
    deadline = time.monotonic() + LONGEST_WAIT_S
    pause_s = _FIRST_PAUSE_S
    while time.monotonic() < deadline:
        found = condition()
        if found:
            return found
        time.sleep(pause_s)
        pause_s = min(_GROWTH * pause_s, _LONGEST_PAUSE_S)
    situation = "" if instead is None else f", but {instead()}"
    raise AssertionError(f"{what}: not within {LONGEST_WAIT_S:g} s{situation}")


async def asked_until(question: Callable[[], Awaitable[Any]]) -> Any:
    """The first true answer to an asynchronous question to other processes."""
    pause_s = _FIRST_PAUSE_S
    async with asyncio.timeout(LONGEST_WAIT_S):
        while not (found := await question()):
            await asyncio.sleep(pause_s)
            pause_s = min(_GROWTH * pause_s, _LONGEST_PAUSE_S)
    return found
