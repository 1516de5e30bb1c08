"""The fleet clock: one time for all domain facts, which may run faster than the wall clock.

Fleet time = fleet_at + (wall time - wall_at) * rate. Every process of a system reads the same
anchor; nothing but this file reads the machine's clock for a domain fact.
"""

import asyncio
import heapq
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Annotated, Protocol, Self

from pydantic import Field, TypeAdapter

from skyway.bounds import Moment

#: The longest single sleep, seconds of wall time: the machine's clock may be set during it.
_LONGEST_SLEEP_S = 60.0


class FleetClock(Protocol):
    """Fleet time and wall time."""

    @property
    def rate(self) -> float:
        """Seconds of fleet time per second of wall time."""
        ...

    def now(self) -> datetime:
        """Fleet time, UTC."""
        ...

    def wall_now(self) -> datetime:
        """Wall time, UTC."""
        ...

    async def sleep_until(self, fleet_moment: datetime) -> None:
        """Return once fleet time has reached the moment; immediately if the moment is past."""
        ...


@dataclass(frozen=True, slots=True)
class AnchoredClock:
    """The clock of a running process: an anchor and the machine's clock."""

    fleet_at: Moment
    wall_at: Moment
    rate: Annotated[float, Field(gt=0, allow_inf_nan=False)]

    @classmethod
    def plain(cls) -> Self:
        """Fleet time is wall time, as in production."""
        moment = datetime.now(UTC)
        return cls(fleet_at=moment, wall_at=moment, rate=1.0)

    def now(self) -> datetime:
        """Fleet time, UTC."""
        return self.fleet_at + (self.wall_now() - self.wall_at) * self.rate

    def wall_now(self) -> datetime:
        """Wall time, UTC."""
        return datetime.now(UTC)

    async def sleep_until(self, fleet_moment: datetime) -> None:
        """Return once fleet time has reached the moment."""
        while True:
            remaining_s = (fleet_moment - self.now()).total_seconds() / self.rate
            if remaining_s <= 0:
                return
            await asyncio.sleep(min(remaining_s, _LONGEST_SLEEP_S))


class ManualClock:
    """A clock that stands still until it is advanced, for tests and replays."""

    def __init__(self, start: datetime, rate: float = 1.0) -> None:
        self.rate = rate
        self._now = start
        self._wall_now = start
        self._sleepers: list[tuple[datetime, int, asyncio.Future[None]]] = []
        self._slept = 0

    def now(self) -> datetime:
        """Fleet time, UTC."""
        return self._now

    def wall_now(self) -> datetime:
        """Wall time, UTC: it starts at the same moment and passes `rate` times slower."""
        return self._wall_now

    async def sleep_until(self, fleet_moment: datetime) -> None:
        """Return once the clock has been advanced to the moment."""
        if fleet_moment <= self._now:
            return
        awake: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._slept += 1
        heapq.heappush(self._sleepers, (fleet_moment, self._slept, awake))
        await awake

    def advance(self, by: timedelta) -> None:
        """Move fleet time on, and wake the sleepers that are due, the earliest first."""
        self._now += by
        self._wall_now += by / self.rate
        while self._sleepers and self._sleepers[0][0] <= self._now:
            _, _, awake = heapq.heappop(self._sleepers)
            if not awake.done():
                awake.set_result(None)


def load_clock(path: Path | None) -> AnchoredClock:
    """The clock whose anchor {fleet_at, wall_at, rate} lies at `path`; without one, plain UTC."""
    if path is None:
        return AnchoredClock.plain()
    return TypeAdapter(AnchoredClock).validate_json(path.read_bytes())


def fleet_margin(clock: FleetClock, *, fleet_s: float, wall_s: float) -> timedelta:
    """The larger of two spans, in fleet time; people and networks need a span of wall time."""
    return timedelta(seconds=max(fleet_s, wall_s * clock.rate))


async def sleep_wall(clock: FleetClock, duration_s: float) -> None:
    """Sleep for a span of wall time, by the clock, so that tests can move it."""
    await clock.sleep_until(clock.now() + timedelta(seconds=duration_s * clock.rate))
