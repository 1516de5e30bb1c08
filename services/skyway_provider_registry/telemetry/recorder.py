"""Writing what is heard: kept in memory for a moment, then many samples in one transaction.

History never holds anything up. When the database is slow or gone, samples wait, and of too many
the oldest are dropped and counted.
"""

from collections import deque
from collections.abc import Iterable
from typing import Final

from skyway.contracts.drone_report import Telemetry
from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.loops import Wake
from skyway.runtime.metrics import count
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_provider_registry.telemetry import store
from skyway_provider_registry.telemetry.store import HeardSample

#: Samples in one transaction.
BATCH: Final = 500
#: Samples that wait at most: half a minute of 5,000 drones in flight, some 50 MiB.
MOST_WAITING: Final = 30_000
#: How far a drone's clock may be off, in seconds of fleet time, and of wall time.
_CLOCK_FLEET_S: Final = 3600.0
_CLOCK_WALL_S: Final = 60.0


class TelemetryRecorder:
    """Takes samples without waiting; `step` writes those that have come."""

    def __init__(self, db: Database, clock: FleetClock, *, most_waiting: int = MOST_WAITING):
        self._db = db
        self._clock = clock
        self._most_waiting = most_waiting
        self._waiting: deque[HeardSample] = deque()
        self._taken: list[HeardSample] = []
        #: Set when there is a full batch.
        self.wake = Wake()

    def take(self, heard: Iterable[tuple[DroneId, Telemetry]]) -> None:
        """Keep samples in mind; one whose moment is far from now has nothing to do with it."""
        now, wall_ms = self._clock.now(), moment_to_ms(self._clock.wall_now())
        margin = fleet_margin(self._clock, fleet_s=_CLOCK_FLEET_S, wall_s=_CLOCK_WALL_S)
        earliest, latest = now - margin, now + margin
        wrong = 0
        for drone_id, sample in heard:
            if earliest <= sample.at <= latest:
                self._waiting.append(HeardSample(drone_id, sample, wall_ms))
            else:
                wrong += 1
        _count_dropped(wrong, reason="clock")
        self._drop_oldest()
        if len(self._waiting) >= BATCH:
            self.wake.set()

    async def step(self) -> bool:
        """Write one batch; True when there is another full one."""
        if not self._taken:
            size = min(BATCH, len(self._waiting))
            self._taken = [self._waiting.popleft() for _ in range(size)]
        if not self._taken:
            return False
        # What could not be written stays taken, and is tried again.
        async with self._db.write() as tx:
            await store.add(tx, self._taken)
        about = "samples written, each by every replica"
        count("skyway_telemetry_written", about, len(self._taken))
        self._taken = []
        return len(self._waiting) >= BATCH

    def _drop_oldest(self) -> None:
        too_many = max(0, len(self._waiting) - self._most_waiting)
        for _ in range(too_many):
            self._waiting.popleft()
        _count_dropped(too_many, reason="database")


def _count_dropped(samples: int, *, reason: str) -> None:
    if samples:
        count("skyway_telemetry_dropped", "samples not written", samples, reason=reason)
