"""Loops that run as long as their process, what stops it, and how often work may begin."""

import asyncio
import contextlib
import logging
import os
import random
import select
import signal
from collections.abc import Awaitable, Callable, Coroutine, Iterator
from datetime import datetime, timedelta
from types import TracebackType
from typing import Any, Never, Self

from skyway.runtime.clock import AnchoredClock, FleetClock, sleep_wall
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.metrics import count

log = logging.getLogger(__name__)

#: Waits after a failed step grow from the first to the second, seconds of wall time.
_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.1, 5.0

#: The longest wait while a part is away: one loop may need the result of another loop that waits
#: too.
_LONGEST_WAIT_FOR_A_PART_S = 1.0

_NO_TIME = timedelta(0)


class Wake:
    """Wakes one waiting loop."""

    def __init__(self) -> None:
        self._event = asyncio.Event()

    def set(self) -> None:
        """Wake the loop now, or as soon as it waits."""
        self._event.set()

    async def wait(self, timeout_s: float) -> bool:
        """Wait until set, at most `timeout_s` seconds of wall time; returns whether it was set."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(timeout_s):
                await self._event.wait()
        was_set = self._event.is_set()
        self._event.clear()
        return was_set


class MissingParts:
    """The parts of the system that a loop waits for; their loss and their return are logged once.

    Without this, a loop would log the same line every second while the database is away.
    """

    def __init__(self, loop: str) -> None:
        self._loop = loop
        self._logged = set[str]()

    def note(self, error: Exception) -> bool:
        """Whether a part that is away caused the error. The part is logged if it is new."""
        part = missing_part(error)
        if part is None:
            return False
        if part.service not in self._logged:
            self._logged.add(part.service)
            log.warning("loop waits", extra={"loop": self._loop, "reason": str(part)})
        return True

    def are_back(self) -> None:
        """Log that the loop goes on, if it waited."""
        if self._logged:
            self._logged.clear()
            log.info("loop goes on", extra={"loop": self._loop})


def missing_part(error: Exception) -> ServiceUnavailable | None:
    """The part of the system that is away; None if the error has any other cause too."""
    if isinstance(error, ServiceUnavailable):
        return error
    if not isinstance(error, ExceptionGroup):
        return None
    parts = [missing_part(each) for each in error.exceptions]
    return None if None in parts else parts[0]


#: Wall seconds between two looks whether the terminal is still there.
_LOOK_EVERY_S = 0.5
_STANDARD_ERROR = 2


@contextlib.contextmanager
def stop_signals(stop: Callable[[str], object]) -> Iterator[None]:
    """Within the block SIGTERM, SIGINT and the loss of the terminal (SIGHUP) call `stop`, once.

    `stop` gets the reason. A process that `nohup` started outlives its terminal.
    """
    loop, reasons = asyncio.get_running_loop(), list[str]()
    numbers = [signal.SIGTERM, signal.SIGINT, signal.SIGHUP]

    def stop_for(reason: str) -> None:
        reasons.append(reason)
        if len(reasons) == 1:
            log.info("asked to stop", extra={"reason": reason})
            stop(reason)

    async def watch(terminal: int) -> None:  # SIGHUP comes only if the terminal controls us
        poll = select.poll()
        poll.register(terminal, 0)
        while not poll.poll(0):  # noqa: ASYNC110 - no event comes
            await asyncio.sleep(_LOOK_EVERY_S)
        stop_for("the terminal is closed")

    watching = None
    if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
        numbers.remove(signal.SIGHUP)
    elif os.isatty(_STANDARD_ERROR):
        watching = loop.create_task(watch(_STANDARD_ERROR))
    for number in numbers:
        loop.add_signal_handler(number, stop_for, number.name)
    try:
        yield
    finally:
        if watching is not None:
            watching.cancel()
        for number in numbers:
            loop.remove_signal_handler(number)


def always() -> bool:
    """Whether to poll now: yes."""
    return True


async def repeat(
    name: str,
    step: Callable[[], Awaitable[bool]],
    *,
    every_s: float,
    wake: Wake | None = None,
    polls: Callable[[], bool] = always,
) -> Never:
    """Run `step` for ever: again immediately after True, else when woken or after `every_s`.

    While it does not `polls`, it is run only when woken: another process looks from time to time.
    A step that fails is counted, and tried again after a growing pause. A bug is logged each time,
    a part of the system that is away only once.
    """
    wake = wake or Wake()
    missing = MissingParts(name)
    failures = 0
    _count_failures(name, 0)
    while True:
        try:
            has_more = await step()
        except Exception as error:
            failures += 1
            _count_failures(name, 1)
            longest_s = _LONGEST_WAIT_FOR_A_PART_S
            if not missing.note(error):
                log.exception("loop step failed", extra={"loop": name, "failures": failures})
                longest_s = _LONGEST_PAUSE_S
            await asyncio.sleep(pause_s(failures, longest_s=longest_s))
            continue
        missing.are_back()
        failures = 0
        if has_more:
            # A step that never waits must not keep the other loops from running, or block a cancel.
            await asyncio.sleep(0)
        else:
            while not await wake.wait(every_s) and not polls():
                pass


def _count_failures(loop: str, failures: int) -> None:
    count("skyway_loop_failures", "steps of loops that failed", failures, loop=loop)


def pause_s(failures: int, *, longest_s: float = _LONGEST_WAIT_FOR_A_PART_S) -> float:
    """Seconds until the next try after so many failures: doubled each time, less some jitter.

    Jitter keeps replicas that failed together from coming back together.
    """
    grown_s = min(_FIRST_PAUSE_S * 2.0 ** min(failures, 10), longest_s)
    return grown_s * random.uniform(0.5, 1.0)  # noqa: S311


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


class Pace:
    """Lets a turn begin at most every `every_s` seconds of wall time; the first one immediately.

    With `burst`, up to that number of unused turns may be used later, at least `least_s` apart. The
    clock measures the time, so that tests can move it; without one it is the machine's clock.
    """

    def __init__(
        self,
        every_s: float = 0.0,
        *,
        burst: int = 0,
        least_s: float = 0.0,
        clock: FleetClock | None = None,
    ) -> None:
        self._clock = AnchoredClock.plain() if clock is None else clock
        self._every = timedelta(seconds=every_s)
        self._ahead = burst * self._every
        self._least = timedelta(seconds=least_s)
        self._began_at: datetime | None = None
        self._due_at: datetime | None = None  # when the next turn begins if no turn was early

    async def turn(self) -> None:
        """Wait until the next turn may begin; one caller waits at a time."""
        wait_s = self._wait_s(self._clock.wall_now())
        if wait_s > 0.0:
            await sleep_wall(self._clock, wait_s)
        else:
            # Callers that are ready now join this turn.
            await asyncio.sleep(0)
        self._began_at = now = self._clock.wall_now()
        self._due_at = (now if self._due_at is None else max(self._due_at, now)) + self._every

    def _wait_s(self, now: datetime) -> float:
        if self._began_at is None or self._due_at is None:
            return 0.0
        if now < self._began_at:
            # The wall clock was set back, so earlier moments cannot be compared with it.
            self._began_at = self._due_at = now
        earliest_at = max(self._due_at - self._ahead, self._began_at + self._least)
        return max(_NO_TIME, earliest_at - now).total_seconds()
