"""All SQL of forecasts: each network has at most one."""

from typing import Final

from sqlalchemy import bindparam, delete, insert, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import NetworkId
from skyway.runtime.sql.database import Tx
from skyway_composition.closures.network_weather import ForecastRow
from skyway_composition.tables import drone_links, forecasts, is_live, missions

#: What identifies a forecast: its SHA-256, and the measured wind that corrects it.
ForecastKey = tuple[str, str | None]

# Built once: they run whenever conditions change, and building takes longer than running.
_OF_NETWORK: Final = forecasts.c.network_id == bindparam("of_network")
_KEY: Final = select(forecasts.c.sha256, forecasts.c.measured).where(_OF_NETWORK)
_READ: Final = select(forecasts).where(_OF_NETWORK)


async def forecast_key(connection: AsyncConnection, network_id: NetworkId) -> ForecastKey | None:
    """What identifies the forecast of a network; None without a forecast."""
    found = await connection.execute(_KEY, {"of_network": network_id})
    row = found.one_or_none()
    return None if row is None else (row.sha256, row.measured)


async def forecast_row(connection: AsyncConnection, network_id: NetworkId) -> ForecastRow | None:
    """The forecast of a network; None without a forecast."""
    found = await connection.execute(_READ, {"of_network": network_id})
    row = found.one_or_none()
    return None if row is None else ForecastRow(*row)


async def replace_forecast(tx: Tx, row: ForecastRow) -> None:
    """Make this the forecast of its network."""
    await delete_forecast(tx, row.network_id)
    await tx.execute(insert(forecasts).values(row._asdict()))


async def delete_forecast(tx: Tx, network_id: NetworkId) -> bool:
    """Remove the forecast of a network; False when it has none."""
    done = await tx.execute(delete(forecasts).where(forecasts.c.network_id == network_id))
    return done.rowcount == 1


async def put_measured(tx: Tx, network_id: NetworkId, measured: str) -> None:
    """Correct the forecast of a network by a measured wind."""
    this = forecasts.c.network_id == network_id
    await tx.execute(update(forecasts).where(this).values(measured=measured))


async def networks_with_forecast(connection: AsyncConnection) -> list[NetworkId]:
    """The networks that have a forecast."""
    found = await connection.execute(
        select(forecasts.c.network_id).order_by(forecasts.c.network_id)
    )
    return list(found.scalars())


async def states_on_missions(
    connection: AsyncConnection, network_id: NetworkId
) -> list[tuple[str, str]]:
    """Provider and newest state, as JSON, of each drone on a mission in a network."""
    found = await connection.execute(
        select(drone_links.c.provider_id, drone_links.c.state)
        .join(missions, missions.c.drone_id == drone_links.c.drone_id)
        .where(missions.c.network_id == network_id, is_live, drone_links.c.state.is_not(None))
    )
    return [(row.provider_id, row.state) for row in found]
