"""Wait until another process has done something, by asking again and again."""

import time
from collections.abc import Callable
from typing import Any

#: Longest wait, in seconds of wall time; generous, because CI machines can be slow.
LONGEST_WAIT_S = 300.0


def eventually(
    condition: Callable[[], Any], what: str, *, instead: Callable[[], object] | None = None
) -> Any:
    """The first true value of a condition on other processes.

    `instead` returns the present situation, for the message of a test that fails.
    """
    deadline = time.monotonic() + LONGEST_WAIT_S
    while time.monotonic() < deadline:
        found = condition()
        if found:
            return found
        time.sleep(0.05)
    situation = "" if instead is None else f", but {instead()}"
    raise AssertionError(f"{what}: not within {LONGEST_WAIT_S:g} s{situation}")
