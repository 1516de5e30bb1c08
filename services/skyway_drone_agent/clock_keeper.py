"""The fleet clock as the cloud sets it, kept on disk for a restart without the cloud.

The clock never goes back. When the cloud restarts, its clock continues where it was (decision
0002). A drone that learns late of a slower clock is ahead of the cloud. Its clock then runs at half
the speed until the cloud has caught up, so that things due by wall time, like heartbeats, go on.
"""

import asyncio
import contextlib
import logging
import os
from datetime import datetime
from pathlib import Path
from typing import Protocol

from skyway.contracts.world import ClockAnchor
from skyway.runtime.clock import AnchoredClock, FleetClock, load_clock

log = logging.getLogger(__name__)

#: Wall seconds to wait for the cloud's anchor after a start. After that the kept anchor is used:
#: the cloud may have restarted at another rate.
WAIT_S = 10.0

#: Speed of a clock that is ahead, as a share of the cloud's clock. What was due in 30 s is then due
#: within a minute.
_WAITING_PACE = 0.5

#: Longest single sleep, in seconds of wall time: the machine's clock may be set meanwhile.
_LONGEST_SLEEP_S = 60.0

#: Seconds that a nap is too long on purpose: uvloop counts in milliseconds, and a sleeper that
#: wakes too early has to nap again.
_TICK_S = 0.001


class ClockFromCloud(FleetClock, Protocol):
    """A fleet clock that the cloud sets."""

    def keep(self, anchor: ClockAnchor) -> None:
        """Use this anchor from now on."""
        ...

    async def wait_until_set(self) -> None:
        """Return once fleet time is set; until then the clock shows wall time."""
        ...


class KeptClock:
    """Uses the newest anchor and never goes back; sleepers wake by the new anchor's time."""

    def __init__(self, path: Path, *, wait_s: float = WAIT_S) -> None:
        self._path = path
        self._wait_s = wait_s
        self._newest = AnchoredClock.plain()
        #: Ahead of the newest clock and slower; None once the newest clock has caught up.
        self._waiting: AnchoredClock | None = None
        self._is_set = asyncio.Event()
        self._napping: set[asyncio.Future[None]] = set()

    @property
    def rate(self) -> float:
        """Seconds of fleet time per second of wall time."""
        return self._ahead().rate

    def now(self) -> datetime:
        """Fleet time, UTC."""
        return self._ahead().now()

    def wall_now(self) -> datetime:
        """Wall time, UTC."""
        return self._newest.wall_now()

    def _ahead(self) -> AnchoredClock:
        """The clock that shows the later time; the slower one is dropped once it is overtaken."""
        if self._waiting is None:
            return self._newest
        if self._newest.now() >= self._waiting.now():
            self._waiting = None
            return self._newest
        return self._waiting

    async def sleep_until(self, fleet_moment: datetime) -> None:
        """Return once fleet time has reached the moment, even if the anchor changes meanwhile."""
        while True:
            remaining_s = self._wall_s_until(fleet_moment)
            if remaining_s <= 0:
                return
            await self._nap(min(remaining_s, _LONGEST_SLEEP_S))

    def _wall_s_until(self, fleet_moment: datetime) -> float:
        """How long it takes until the first of the two clocks shows this moment."""
        clocks = (self._newest,) if self._waiting is None else (self._newest, self._waiting)
        return min((fleet_moment - clock.now()).total_seconds() / clock.rate for clock in clocks)

    async def _nap(self, wall_s: float) -> None:
        """Sleep for a while, or until there is another anchor.

        A timer and a future: a fleet naps thousands of times a second.
        """
        loop = asyncio.get_running_loop()
        awake: asyncio.Future[None] = loop.create_future()
        timer = loop.call_later(wall_s + _TICK_S, _wake, awake)
        self._napping.add(awake)
        try:
            await awake
        finally:
            timer.cancel()
            self._napping.discard(awake)

    async def wait_until_set(self) -> None:
        """Return once the cloud has sent its anchor, or after a while with the kept anchor."""
        if self._path.exists() and not self._is_set.is_set():
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(self._wait_s):
                    await self._is_set.wait()
            if not self._is_set.is_set():
                self._go_by(load_clock(self._path))
        await self._is_set.wait()

    def keep(self, anchor: ClockAnchor) -> None:
        """Use this anchor from now on, and after a restart."""
        clock = AnchoredClock(anchor.fleet_at, anchor.wall_at, anchor.rate)
        if self._is_set.is_set() and clock == self._newest:
            return
        self._go_by(clock)
        try:
            self._write(anchor)
        except OSError as error:
            # A full disk: only a restart without the cloud needs the file.
            log.warning("fleet clock not kept", extra={"error": str(error)})

    def _write(self, anchor: ClockAnchor) -> None:
        # The process id is in the name: agents of other drones may share the folder.
        beside = self._path.with_suffix(f".{os.getpid()}")
        beside.write_text(anchor.model_dump_json(include={"fleet_at", "wall_at", "rate"}))
        beside.replace(self._path)

    def _go_by(self, clock: AnchoredClock) -> None:
        if self._is_set.is_set():
            reached, wall_at = self.now(), self.wall_now()
            self._waiting = AnchoredClock(reached, wall_at, clock.rate * _WAITING_PACE)
        self._newest = clock
        self._is_set.set()
        for awake in tuple(self._napping):
            _wake(awake)


def _wake(awake: "asyncio.Future[None]") -> None:
    if not awake.done():
        awake.set_result(None)
