"""Corrects forecasts by the wind that drones on missions measure."""

import asyncio
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from skyway.contracts.weather import MeasuredWind
from skyway.ids import NetworkId
from skyway.planner.measured_wind import Measurement, corrections_of, measurements_of
from skyway.runtime.clock import FleetClock
from skyway.runtime.loops import Wake
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures.network_weather import ForecastRow, StoredForecast
from skyway_composition.closures.read_forecast import forecast_of
from skyway_composition.closures.store import (
    change_conditions,
    forecast_key,
    forecast_row,
    networks_with_forecast,
    put_measured,
    states_on_missions,
)
from skyway_composition.networks.store import lock_version

log = logging.getLogger(__name__)

#: The least time between two corrections of a forecast, and how long the same correction counts as
#: new, fleet milliseconds. After each correction QUEUED missions are planned again.
_AT_MOST_EVERY_MS: Final = 600_000
_SAME_FOR_MS: Final = 1_800_000


@dataclass(frozen=True, slots=True)
class MeasuredWinds:
    """Corrects the forecasts of all networks; wakes `calendars`, which then need other plans."""

    db: Database
    clock: FleetClock
    calendars: Wake

    async def step(self) -> bool:
        """Look at each network that has a forecast."""
        async with self.db.read() as connection:
            network_ids = await networks_with_forecast(connection)
        for network_id in network_ids:
            await self._look_at(network_id)
        return False

    async def _look_at(self, network_id: NetworkId) -> None:
        now_ms = moment_to_ms(self.clock.now())
        async with self.db.read() as connection:
            key = await forecast_key(connection, network_id)
            before = None if key is None or key[1] is None else MeasuredWind.read(key[1])
            if before is not None and now_ms < moment_to_ms(before.at) + _AT_MOST_EVERY_MS:
                return
            measured = [*measurements_of(await states_on_missions(connection, network_id))]
            if not measured and (before is None or not before.places):
                return
            row = await forecast_row(connection, network_id)
        if row is None:
            return
        found = await asyncio.to_thread(_correction, row, measured, now_ms=now_ms)
        if _is_news(before, found, now_ms=now_ms):
            await self._put(row, found)

    async def _put(self, row: ForecastRow, found: MeasuredWind) -> None:
        """Save a correction, unless the forecast has changed since it was read."""
        async with self.db.write() as tx:
            await lock_version(tx, row.network_id)
            if await forecast_key(tx.connection, row.network_id) != (row.sha256, row.measured):
                return
            await put_measured(tx, row.network_id, found.model_dump_json())
            await change_conditions(tx, row.network_id)
            tx.after_commit(self.calendars.set)
        about = {"network_id": row.network_id, "places": len(found.places)}
        log.info("forecast corrected by measured wind", extra=about)


def _is_news(before: MeasuredWind | None, found: MeasuredWind, *, now_ms: int) -> bool:
    """Whether a correction differs from the stored one, or renews one that is old and has faded."""
    earlier = () if before is None else before.places
    is_old = before is not None and moment_to_ms(before.at) + _SAME_FOR_MS <= now_ms
    return earlier != found.places or (bool(earlier) and is_old)


def _correction(row: ForecastRow, measured: Sequence[Measurement], *, now_ms: int) -> MeasuredWind:
    """The difference between these measurements and the forecast as its source sent it."""
    forecast = forecast_of(StoredForecast.read(row).document)
    found = corrections_of(forecast, measured, now_s=now_ms / 1000)
    places = tuple((place, east, north) for place, (east, north) in found.items())
    return MeasuredWind(at=ms_to_moment(now_ms), places=places)
