"""Change the forecast of a network: plans, missions and the network's conditions follow.

A booking checks in its own transaction that the conditions are the ones it planned with. So no plan
for an earlier forecast is booked after a new one was accepted. QUEUED missions are planned again.
"""

import asyncio
from dataclasses import dataclass, replace

from skyway.contracts.weather import ForecastDocument, MeasuredWind, WeatherInForce
from skyway.ids import NetworkId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import NotFound
from skyway.runtime.loops import Wake
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms
from skyway_composition.closures.closure import Impact
from skyway_composition.closures.network_weather import (
    ForecastRow,
    NetworkWeather,
    StoredForecast,
)
from skyway_composition.closures.read_forecast import accepted, content_of
from skyway_composition.closures.store import (
    change_conditions,
    delete_forecast,
    forecast_row,
    replace_forecast,
)
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.networks.store import current_version, lock_version


@dataclass(frozen=True, slots=True)
class WeatherChanges:
    """Replaces and removes forecasts; wakes `calendars`, since QUEUED missions need other plans."""

    db: Database
    networks: PreparedNetworks
    impact: Impact
    clock: FleetClock
    calendars: Wake

    async def put(self, network_id: NetworkId, document: ForecastDocument) -> WeatherInForce:
        """Make this the forecast of a network; the same content changes nothing.

        Raises
        ------
        NotFound
            There is no such network.
        InvalidInput
            The network cannot plan with this forecast.
        """
        skyway = await self.networks.current(network_id)
        now_ms = self._now_ms
        placed = await asyncio.to_thread(accepted, document, skyway.network, now_ms=now_ms)
        content, sha256 = await asyncio.to_thread(content_of, placed)
        row = ForecastRow(network_id, sha256, now_ms, content)
        stored = StoredForecast(network_id, sha256, now_ms, placed)
        weather = await asyncio.to_thread(
            NetworkWeather.of, stored, skyway.network, reserve_risk=skyway.settings.reserve_risk
        )
        # Computed before the transaction, so that the network is locked for a short time only.
        for model in await self.impact.models_in_flight(self.db, network_id):
            await asyncio.to_thread(weather.of_model, model)
        async with self.db.write() as tx:
            await self._lock(tx, network_id)
            before = await forecast_row(tx.connection, network_id)
            if before is not None and before.sha256 == sha256:
                measured = None if before.measured is None else MeasuredWind.read(before.measured)
                unchanged = replace(stored, received_ms=before.received_ms, measured=measured)
                return unchanged.in_force(now_ms=now_ms)
            await change_conditions(tx, network_id)
            await replace_forecast(tx, row)
            await self.impact.apply_weather(tx, network_id, weather)
            await self.impact.retry(tx, network_id)
            tx.after_commit(self.calendars.set)
        return stored.in_force(now_ms=now_ms)

    async def remove(self, network_id: NetworkId) -> None:
        """Remove the weather of a network: plans assume still air until drones measure wind.

        A network without a forecast stays as it is.

        Raises
        ------
        NotFound
            There is no such network.
        """
        async with self.db.write() as tx:
            await self._lock(tx, network_id)
            if await delete_forecast(tx, network_id):
                await change_conditions(tx, network_id)
                await self.impact.retry(tx, network_id)
                tx.after_commit(self.calendars.set)

    async def in_force(self, network_id: NetworkId) -> WeatherInForce:
        """The forecast of a network.

        Raises
        ------
        NotFound
            There is no such network, or it has no forecast.
        """
        async with self.db.read() as connection:
            row = await forecast_row(connection, network_id)
            if row is None and await current_version(connection, network_id) is None:
                raise NotFound("network", network_id)
        if row is None:
            advice = "its plans assume still air"
            raise NotFound("forecast for network", network_id, advice=advice)
        stored = await asyncio.to_thread(StoredForecast.read, row)
        return stored.in_force(now_ms=self._now_ms)

    async def _lock(self, tx: Tx, network_id: NetworkId) -> None:
        if await lock_version(tx, network_id) is None:
            raise NotFound("network", network_id)

    @property
    def _now_ms(self) -> int:
        return moment_to_ms(self.clock.now())
