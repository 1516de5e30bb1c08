"""Waiting for what other processes do, which only asking can tell."""

import time
from collections.abc import Callable
from typing import Any

#: Wall seconds after which nobody believes any more that it will come, however slow the machine.
PATIENCE_S = 300.0


def eventually(
    condition: Callable[[], Any], what: str, *, told: Callable[[], object] | None = None
) -> Any:
    """The first true value of a condition on other processes.

    `told` is what is there instead, for people who wonder why it never came true.
    """
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        found = condition()
        if found:
            return found
        time.sleep(0.05)
    instead = "" if told is None else f", but {told()}"
    raise AssertionError(f"{what}: not within {PATIENCE_S:g} s{instead}")
