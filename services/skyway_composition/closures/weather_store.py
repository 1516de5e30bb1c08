"""All SQL of forecasts: each network has at most one."""

from typing import Final

from sqlalchemy import bindparam, delete, insert, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import NetworkId
from skyway.runtime.sql.database import Tx
from skyway_composition.closures.network_weather import ForecastRow
from skyway_composition.tables import forecasts

# Built once: they run whenever conditions change, and building takes longer than running.
_OF_NETWORK: Final = forecasts.c.network_id == bindparam("of_network")
_HASH: Final = select(forecasts.c.sha256).where(_OF_NETWORK)
_READ: Final = select(forecasts).where(_OF_NETWORK)


async def forecast_hash(connection: AsyncConnection, network_id: NetworkId) -> str | None:
    """The SHA-256 of the forecast of a network; None without one."""
    found = await connection.execute(_HASH, {"of_network": network_id})
    sha256: str | None = found.scalar_one_or_none()
    return sha256


async def forecast_row(connection: AsyncConnection, network_id: NetworkId) -> ForecastRow | None:
    """The forecast of a network; None without one."""
    found = await connection.execute(_READ, {"of_network": network_id})
    row = found.one_or_none()
    if row is None:
        return None
    return ForecastRow(row.network_id, row.sha256, row.received_ms, row.content)


async def replace_forecast(tx: Tx, row: ForecastRow) -> None:
    """Make this the forecast of its network."""
    await delete_forecast(tx, row.network_id)
    await tx.execute(insert(forecasts).values(row._asdict()))


async def delete_forecast(tx: Tx, network_id: NetworkId) -> bool:
    """Remove the forecast of a network; False when it has none."""
    done = await tx.execute(delete(forecasts).where(forecasts.c.network_id == network_id))
    return done.rowcount == 1
