"""Stores telemetry: samples wait in memory for a moment, then many go into one transaction.

Telemetry never delays anything else. When the database is slow or gone, samples wait. When too many
wait, the oldest are dropped and counted.
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
from skyway_provider_registry.telemetry.store import ReceivedSample

#: Samples in one transaction.
BATCH: Final = 500
#: Most samples that wait: half a minute of 5,000 drones in flight, about 50 MiB.
MOST_WAITING: Final = 30_000
#: How far a drone's clock may be off, in seconds of fleet time, and of wall time.
_CLOCK_FLEET_S: Final = 3600.0
_CLOCK_WALL_S: Final = 60.0


class TelemetryRecorder:
    """`accept` takes samples without waiting; `step` writes them."""

    def __init__(self, db: Database, clock: FleetClock, *, most_waiting: int = MOST_WAITING):
        self._db = db
        self._clock = clock
        self._most_waiting = most_waiting
        self._waiting: deque[ReceivedSample] = deque()
        self._batch: list[ReceivedSample] = []
        #: Set when there is a full batch.
        self.wake = Wake()

    def accept(self, samples: Iterable[tuple[DroneId, Telemetry]]) -> None:
        """Queue samples; a sample whose moment is far from now is dropped and counted."""
        now, wall_ms = self._clock.now(), moment_to_ms(self._clock.wall_now())
        margin = fleet_margin(self._clock, fleet_s=_CLOCK_FLEET_S, wall_s=_CLOCK_WALL_S)
        earliest, latest = now - margin, now + margin
        wrong = 0
        for drone_id, sample in samples:
            if earliest <= sample.at <= latest:
                self._waiting.append(ReceivedSample(drone_id, sample, wall_ms))
            else:
                wrong += 1
        _count_dropped(wrong, reason="clock")
        self._drop_oldest()
        if len(self._waiting) >= BATCH:
            self.wake.set()

    async def step(self) -> bool:
        """Write one batch; True when another full batch waits."""
        if not self._batch:
            size = min(BATCH, len(self._waiting))
            self._batch = [self._waiting.popleft() for _ in range(size)]
        if not self._batch:
            return False
        # A batch that could not be written stays, and is tried again.
        async with self._db.write() as tx:
            await store.add(tx, self._batch)
        help_text = "samples written, each by every replica"
        count("skyway_telemetry_written", help_text, len(self._batch))
        self._batch = []
        return len(self._waiting) >= BATCH

    def _drop_oldest(self) -> None:
        too_many = max(0, len(self._waiting) - self._most_waiting)
        for _ in range(too_many):
            self._waiting.popleft()
        _count_dropped(too_many, reason="database")


def _count_dropped(samples: int, *, reason: str) -> None:
    if samples:
        count("skyway_telemetry_dropped", "samples not written", samples, reason=reason)
