"""Keeping less of what is older: minutes in the place of samples, then nothing."""

import asyncio
from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_provider_registry.telemetry import thinning_store

#: Wall seconds between two transactions, so that others come in between.
PAUSE_S: Final = 0.1


@dataclass(frozen=True, slots=True)
class Keeping:
    """How long samples, and then minutes, are kept: wall time from when they were heard."""

    samples_for: timedelta
    minutes_for: timedelta


class Thinning:
    """One round after another through the drones of which anything is kept.

    Each transaction handles about five hundred rows of one drone. Replicas may do the same at the
    same time: what one has done, the other finds done.
    """

    def __init__(
        self, db: Database, clock: FleetClock, keeping: Keeping, *, pause_s: float = PAUSE_S
    ) -> None:
        self._db = db
        self._clock = clock
        self._keeping = keeping
        self._pause_s = pause_s
        self._done = ""

    async def step(self) -> bool:
        """Thin what is kept of the next drone; False at the end of a round."""
        async with self._db.read() as connection:
            drone_id = await thinning_store.next_drone(connection, after=self._done)
            if drone_id is None:
                self._done = ""
                return False
            is_registered = await thinning_store.is_registered(connection, drone_id)
        has_more = True
        while has_more:
            if is_registered:
                has_more = await self._thin(drone_id)
            else:
                has_more = await self._forget(drone_id)
            await asyncio.sleep(self._pause_s)
        self._done = drone_id
        return True

    async def _thin(self, drone_id: DroneId) -> bool:
        wall_now = self._clock.wall_now()
        samples_ms = moment_to_ms(wall_now - self._keeping.samples_for)
        minutes_ms = moment_to_ms(wall_now - self._keeping.minutes_for)
        async with self._db.write() as tx:
            has_samples = await thinning_store.thin(tx, drone_id, heard_before_ms=samples_ms)
            has_minutes = await thinning_store.forget_minutes(
                tx, drone_id, heard_before_ms=minutes_ms
            )
        return has_samples or has_minutes

    async def _forget(self, drone_id: DroneId) -> bool:
        """Nothing is kept of a drone that was removed."""
        async with self._db.write() as tx:
            return await thinning_store.forget_all(tx, drone_id)
