"""Thins old telemetry: samples become minutes, and old minutes are deleted."""

import asyncio
from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_provider_registry.telemetry import store

#: Wall seconds between two transactions, so that other writers get a turn.
PAUSE_S: Final = 0.1


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
