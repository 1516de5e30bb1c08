"""Loops that run as long as their process: one step after another."""

import asyncio
import contextlib
import logging
import random
from collections.abc import Awaitable, Callable, Coroutine
from types import TracebackType
from typing import Any, Never, Self

from skyway.runtime.metrics import count

log = logging.getLogger(__name__)

#: Waits after a failed step grow from the first to the second, seconds of wall time.
_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.1, 5.0


class Wake:
    """Wakes one waiting loop."""

    def __init__(self) -> None:
        self._event = asyncio.Event()

    def set(self) -> None:
        """Let the loop go on, now or as soon as it waits."""
        self._event.set()

    async def wait(self, timeout_s: float) -> None:
        """Return when set, at the latest after `timeout_s` seconds of wall time."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(timeout_s):
                await self._event.wait()
        self._event.clear()


async def repeat(
    name: str, step: Callable[[], Awaitable[bool]], *, every_s: float, wake: Wake | None = None
) -> Never:
    """Run `step` for ever: again immediately after True, else when woken or after `every_s`.

    A step that fails is logged and counted, and tried again after a growing pause.
    """
    wake = wake or Wake()
    failures = 0
    while True:
        try:
            has_more = await step()
        except Exception:
            failures += 1
            count("skyway_loop_failures", "steps of loops that failed", loop=name)
            log.exception("loop step failed", extra={"loop": name, "failures": failures})
            await asyncio.sleep(_pause_s(failures))
            continue
        failures = 0
        if has_more:
            # A step that never waits must not keep the other loops from running, or block a cancel.
            await asyncio.sleep(0)
        else:
            await wake.wait(every_s)


def _pause_s(failures: int) -> float:
    # Jitter keeps replicas that failed together from coming back together.
    longest_s = min(_FIRST_PAUSE_S * 2.0 ** min(failures, 10), _LONGEST_PAUSE_S)
    return longest_s * random.uniform(0.5, 1.0)  # noqa: S311


class Loops:
    """The loops of a process, all cancelled when the block is left.

    A coroutine that ends with an error ends the others too, and the error leaves the block.
    """

    def __init__(self) -> None:
        self._group = asyncio.TaskGroup()
        self._tasks: list[asyncio.Task[None]] = []

    async def __aenter__(self) -> Self:
        await self._group.__aenter__()
        return self

    def start(self, name: str, coroutine: Coroutine[Any, Any, None]) -> None:
        """Run the coroutine from now on; Any, since what it yields to the loop is asyncio's."""
        self._tasks.append(self._group.create_task(coroutine, name=name))

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for task in self._tasks:
            task.cancel()
        await self._group.__aexit__(kind, error, trace)
