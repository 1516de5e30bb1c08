"""The wind that drones on missions measure: it corrects a forecast, or counts instead of one."""

import asyncio
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

from skyway.contracts.weather import ForecastDocument, MeasuredWind
from skyway.ids import NetworkId
from skyway.planner.measured_wind import (
    HOLDS_S,
    Measurement,
    air_of,
    corrections_of,
    measurements_of,
)
from skyway.runtime.clock import FleetClock
from skyway.runtime.loops import Wake
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures.network_weather import ForecastRow, StoredForecast
from skyway_composition.closures.read_forecast import content_of, forecast_of
from skyway_composition.closures.store import (
    ForecastKey,
    change_conditions,
    delete_forecast,
    forecast_key,
    forecast_row,
    networks_in_weather,
    replace_forecast,
    states_on_missions,
)
from skyway_composition.networks.store import lock_version

log = logging.getLogger(__name__)

#: The least time between two corrections of a forecast, and how long the same correction counts as
#: new, fleet milliseconds. After each correction QUEUED missions are planned again.
_AT_MOST_EVERY_MS: Final = 600_000
_SAME_FOR_MS: Final = 1_800_000

#: How old measured wind may be to be averaged with newer wind, fleet milliseconds. Our own choice.
_AVERAGED_FOR_MS: Final = 3_600_000

#: How long measured air counts when no drone measures any more, fleet milliseconds. If all drones
#: wait for the wind, one of them must try again.
_COUNTS_FOR_MS: Final = 10_800_000


@dataclass(frozen=True, slots=True)
class MeasuredWinds:
    """Renews the weather of all networks; wakes `calendars`, which then need other plans."""

    db: Database
    clock: FleetClock
    calendars: Wake

    async def step(self) -> bool:
        """Look at each network that has a forecast, or drones that measure the air."""
        async with self.db.read() as connection:
            network_ids = await networks_in_weather(connection)
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
        found = await asyncio.to_thread(_renewed, network_id, row, measured, now_ms=now_ms)
        if found != row:
            await self._put(network_id, found, instead_of=key)

    async def _put(
        self, network_id: NetworkId, row: ForecastRow | None, *, instead_of: ForecastKey | None
    ) -> None:
        """Save measured wind, or None if it is over, unless the weather has changed meanwhile."""
        async with self.db.write() as tx:
            version = await lock_version(tx, network_id)
            if version is None or await forecast_key(tx.connection, network_id) != instead_of:
                return
            if row is None:
                await delete_forecast(tx, network_id)
            else:
                await replace_forecast(tx, row)
            await change_conditions(tx, network_id)
            tx.after_commit(self.calendars.set)
        log.info("weather renewed by measured wind", extra={"network_id": network_id})


def _renewed(
    network_id: NetworkId, row: ForecastRow | None, measured: Sequence[Measurement], *, now_ms: int
) -> ForecastRow | None:
    """The weather by these measurements; the row itself if it has about the same."""
    stored = None if row is None else StoredForecast.read(row)
    if row is None or stored is None or stored.is_measured:
        return _measured(network_id, row, stored, measured, now_ms=now_ms)
    return _corrected(row, stored, measured, now_ms=now_ms)


def _measured(
    network_id: NetworkId,
    row: ForecastRow | None,
    stored: StoredForecast | None,
    measured: Sequence[Measurement],
    *,
    now_ms: int,
) -> ForecastRow | None:
    """Measured air instead of a forecast; None if there is none, or none any more."""
    age_ms = 0 if stored is None else _age_ms(stored, now_ms=now_ms)
    air = air_of(measured, now_s=now_ms / 1000)
    if air is None:
        return row if age_ms < _COUNTS_FOR_MS else None
    if stored is not None and stored.measured is not None and age_ms < _AVERAGED_FOR_MS:
        [(_, east_mps, north_mps)] = stored.measured.places
        air = air.averaged((east_mps, north_mps))
    said = partial(ForecastDocument.measured, air.by_name, holds_s=HOLDS_S)
    document = None if stored is None else stored.document
    is_same = document is not None and document == said(document.issued_at)
    if is_same and age_ms < _SAME_FOR_MS:
        return row
    now = ms_to_moment(now_ms)
    content, sha256 = content_of(said(now))
    wind = MeasuredWind(at=now, places=((0, air.east_mps, air.north_mps),))
    return ForecastRow(network_id, sha256, now_ms, content, wind.model_dump_json())


def _corrected(
    row: ForecastRow, stored: StoredForecast, measured: Sequence[Measurement], *, now_ms: int
) -> ForecastRow:
    """The forecast, corrected by how much measured wind differs from what its source sent."""
    found = corrections_of(forecast_of(stored.document), measured, now_s=now_ms / 1000)
    places = tuple((place, east, north) for place, (east, north) in found.items())
    earlier = () if stored.measured is None else stored.measured.places
    is_fresh = _age_ms(stored, now_ms=now_ms) < _SAME_FOR_MS
    if places == earlier and (is_fresh or not earlier):
        return row
    wind = MeasuredWind(at=ms_to_moment(now_ms), places=places)
    return row._replace(measured=wind.model_dump_json())


def _age_ms(stored: StoredForecast, *, now_ms: int) -> int:
    """How long ago drones measured the wind; 0 if they have not."""
    return 0 if stored.measured is None else now_ms - moment_to_ms(stored.measured.at)
