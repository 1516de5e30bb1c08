"""Keeps telemetry: stores new samples, and thins old ones to minutes that are deleted later.

Telemetry never delays anything else. Samples wait in memory for a moment, then many go into one
transaction. When the database is slow or gone, samples wait longer. When too many wait, the oldest
are dropped and counted.
"""

import asyncio
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta
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

#: Wall seconds between two transactions, so that other writers get a turn.
PAUSE_S: Final = 0.1


class TelemetryRecorder:
    """`accept` takes samples without waiting; `step` writes them."""

    def __init__(self, db: Database, clock: FleetClock, *, most_waiting: int = MOST_WAITING):
        self._db = db
        self._clock = clock
        self._most_waiting = most_waiting
        self._waiting: deque[ReceivedSample] = deque()
        self._batch: list[ReceivedSample] = []
        #: The moment of the newest sample that was accepted, fleet time.
        self.newest_at: datetime | None = None
        #: Set when there is a full batch.
        self.wake = Wake()
        for reason in ("clock", "database"):
            _count_dropped(0, reason=reason)

    def accept(self, samples: Iterable[tuple[DroneId, Telemetry]]) -> None:
        """Queue samples; a sample whose moment is far from now is dropped and counted."""
        now, wall_ms = self._clock.now(), moment_to_ms(self._clock.wall_now())
        margin = fleet_margin(self._clock, fleet_s=_CLOCK_FLEET_S, wall_s=_CLOCK_WALL_S)
        earliest, latest = now - margin, now + margin
        wrong = 0
        for drone_id, sample in samples:
            if earliest <= sample.at <= latest:
                self._waiting.append(ReceivedSample(drone_id, sample, wall_ms))
                self.newest_at = max(self.newest_at or sample.at, sample.at)
            else:
                wrong += 1
        _count_dropped(wrong, reason="clock")
        self._drop_oldest()
        if len(self._waiting) >= BATCH:
            self.wake.set()

    @property
    def depth(self) -> int:
        """How many samples wait to be written."""
        return len(self._waiting) + len(self._batch)

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
    count("skyway_telemetry_dropped", "samples not written", samples, reason=reason)


@dataclass(frozen=True, slots=True)
class KeepTimes:
    """How long samples and minutes are kept, wall time since they were received."""

    samples_for: timedelta
    minutes_for: timedelta


class Thinning:
    """Goes through all drones with telemetry, again and again.

    Each transaction handles about five hundred rows of one drone. Several replicas may do so at the
    same time: rows that one replica has thinned are gone for the others.
    """

    def __init__(
        self, db: Database, clock: FleetClock, keeping: KeepTimes, *, pause_s: float = PAUSE_S
    ) -> None:
        self._db = db
        self._clock = clock
        self._keeping = keeping
        self._pause_s = pause_s
        self._done = ""

    async def step(self) -> bool:
        """Step of a loop: thin the telemetry of the next drone; False at the end of a round."""
        async with self._db.read() as connection:
            drone_id = await store.next_drone(connection, after=self._done)
            if drone_id is None:
                self._done = ""
                return False
            is_registered = await store.is_registered(connection, drone_id)
        has_more = True
        while has_more:
            if is_registered:
                has_more = await self._thin(drone_id)
            else:
                has_more = await self._delete(drone_id)
            await asyncio.sleep(self._pause_s)
        self._done = drone_id
        return True

    async def _thin(self, drone_id: DroneId) -> bool:
        wall_now = self._clock.wall_now()
        samples_ms = moment_to_ms(wall_now - self._keeping.samples_for)
        minutes_ms = moment_to_ms(wall_now - self._keeping.minutes_for)
        async with self._db.write() as tx:
            has_samples = await store.thin(tx, drone_id, received_before_ms=samples_ms)
            has_minutes = await store.delete_minutes(tx, drone_id, received_before_ms=minutes_ms)
        return has_samples or has_minutes

    async def _delete(self, drone_id: DroneId) -> bool:
        """Delete the telemetry of a removed drone."""
        async with self._db.write() as tx:
            return await store.delete_all(tx, drone_id)
