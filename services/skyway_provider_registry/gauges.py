"""The gauges of the registry."""

import asyncio
from dataclasses import dataclass
from pathlib import Path
from typing import Final, get_args

from skyway.broker_setup.account_files import refused_logins_file
from skyway.runtime.clock import FleetClock
from skyway.runtime.metrics import Gauge, GaugeSource
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_provider_registry.fleets import statistics_store
from skyway_provider_registry.fleets.drone import DroneStateName
from skyway_provider_registry.fleets.statistics_store import totals
from skyway_provider_registry.presence.drone_presence import SILENCE
from skyway_provider_registry.telemetry.keep_telemetry import TelemetryRecorder

#: How long the states of drones are kept, wall seconds: they are counted over all drones.
_DRONES_KEPT_S: Final = 15.0


@dataclass(frozen=True, slots=True)
class RegistryGauges:
    """What stands at the registry now."""

    db: Database
    clock: FleetClock
    recorder: TelemetryRecorder
    password_file: Path

    def sources(self) -> tuple[GaugeSource, ...]:
        """Where the gauges come from."""
        return (
            GaugeSource("drones", self._drones, kept_s=_DRONES_KEPT_S),
            GaugeSource("telemetry", self._telemetry, kept_s=0.0),
            GaugeSource("broker", self._broker, kept_s=0.0),
        )

    async def _broker(self) -> list[Gauge]:
        """What the embedded broker counts; nothing of another broker."""
        try:
            refused = int(
                await asyncio.to_thread(refused_logins_file(self.password_file).read_text)
            )
        except (OSError, ValueError):
            return []
        about = "logins that the embedded broker refused since its start"
        return [Gauge("skyway_broker_logins_refused", about, refused)]

    async def _drones(self) -> list[Gauge]:
        now, since_ms = self.clock.now(), moment_to_ms(self.clock.wall_now() - SILENCE)
        async with self.db.survey() as connection:
            rows = await statistics_store.groups(connection, None, received_since_wall_ms=since_ms)
        fleet = totals(rows, at=now, rate=self.clock.rate, next_free_ms=None)
        readings = [
            Gauge("skyway_drones", "drones", fleet.by_state.get(state, 0), {"state": state})
            for state in get_args(DroneStateName)
        ]
        if fleet.lag_mean_s is not None and fleet.lag_max_s is not None:
            about = "time from sending to receiving the newest message of online drones"
            readings += [
                Gauge("skyway_drone_lag_mean_seconds", f"mean {about}", fleet.lag_mean_s),
                Gauge("skyway_drone_lag_max_seconds", f"longest {about}", fleet.lag_max_s),
            ]
        return readings

    async def _telemetry(self) -> list[Gauge]:
        about = "samples that wait to be written"
        readings = [Gauge("skyway_telemetry_depth", about, self.recorder.depth)]
        if self.recorder.newest_at is not None:
            age_s = (self.clock.now() - self.recorder.newest_at).total_seconds() / self.clock.rate
            about = "time since the moment of the newest sample of all drones"
            readings.append(Gauge("skyway_telemetry_age_seconds", about, max(age_s, 0.0)))
        return readings
