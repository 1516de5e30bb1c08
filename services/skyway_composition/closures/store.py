"""All SQL of closures, and of forecasts: each network has at most one."""

from dataclasses import dataclass, fields
from typing import Any, Final

from sqlalchemy import Row, bindparam, delete, insert, or_, select, true, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.statistics import Span
from skyway.geo import Position
from skyway.ids import ClosureId, NetworkId, StationId
from skyway.runtime.errors import NotFound
from skyway.runtime.sql.database import Tx
from skyway_composition.closures.closure import Area, Closure, ClosureKind
from skyway_composition.closures.network_weather import ForecastRow
from skyway_composition.tables import (
    closures,
    drone_links,
    forecasts,
    is_live,
    missions,
    networks,
    stations,
)

#: The closures that one transaction deletes at most.
_DELETED_TOGETHER: Final = 500

# Built once, because these statements run every second and building takes longer than running.
_IN_FORCE: Final = select(closures).where(
    closures.c.lifted_ms.is_(None),
    closures.c.from_ms <= bindparam("at_ms"),
    or_(closures.c.until_ms.is_(None), closures.c.until_ms > bindparam("at_ms")),
)
_NOT_OVER: Final = (
    select(closures)
    .where(
        closures.c.lifted_ms.is_(None),
        or_(closures.c.until_ms.is_(None), closures.c.until_ms > bindparam("at_ms")),
    )
    .order_by(closures.c.closure_id)
)
_OUTAGES: Final = _IN_FORCE.where(closures.c.kind == "PAD")
_OUTAGES_AT: Final = _OUTAGES.where(closures.c.station_id == bindparam("station_id"))
_GROUND_STOPS: Final = _IN_FORCE.where(closures.c.kind == "GROUND_STOP")
_CLOSED_STATIONS: Final = _IN_FORCE.where(
    closures.c.kind == "STATION", closures.c.network_id == bindparam("network_id")
).with_only_columns(closures.c.station_id)


@dataclass(frozen=True, slots=True)
class ClosureFilter:
    """Which closures a list shows; without `lasting_beyond_ms` also closures that have ended."""

    kind: ClosureKind
    lasting_beyond_ms: int | None
    station_id: StationId | None = None
    pad: int | None = None
    to_station_id: StationId | None = None


async def in_force(
    connection: AsyncConnection, network_id: NetworkId, *, after_ms: int
) -> tuple[Closure, ...]:
    """The closures of a network that end after this moment, with ground stops for all networks."""
    found = await connection.execute(
        select(closures)
        .where(
            or_(closures.c.network_id == network_id, closures.c.network_id.is_(None)),
            closures.c.lifted_ms.is_(None),
            or_(closures.c.until_ms.is_(None), closures.c.until_ms > after_ms),
        )
        .order_by(closures.c.closure_id)
    )
    return tuple(_closure(row) for row in found)


async def conditions_number(connection: AsyncConnection, network_id: NetworkId) -> int:
    """How often the conditions of a network have changed."""
    found = await connection.execute(
        select(networks.c.conditions).where(networks.c.network_id == network_id)
    )
    number: int = found.scalar_one()
    return number


async def change_conditions(tx: Tx, network_id: NetworkId | None) -> None:
    """Count up the conditions of a network, or of all networks, as this transaction changes them.

    Raises
    ------
    NotFound
        There is no such network.
    """
    which = true() if network_id is None else networks.c.network_id == network_id
    # Every transaction locks in this order; an UPDATE of many rows would lock in any order.
    locked = await tx.execute(
        select(networks.c.network_id).where(which).order_by(networks.c.network_id).with_for_update()
    )
    if network_id is not None and locked.scalar_one_or_none() is None:
        raise NotFound("network", network_id)
    await tx.execute(update(networks).where(which).values(conditions=networks.c.conditions + 1))


async def add(tx: Tx, closure: Closure) -> None:
    """Add a closure."""
    row = {each.name: getattr(closure, each.name) for each in fields(closure)}
    area = None if closure.area is None else closure.area.model_dump_json()
    await tx.execute(insert(closures).values(row | {"area": area}))


async def lift(tx: Tx, closure_id: ClosureId, *, now_ms: int) -> bool:
    """Lift a closure; False when it was lifted before."""
    done = await tx.execute(
        update(closures)
        .where(closures.c.closure_id == closure_id, closures.c.lifted_ms.is_(None))
        .values(lifted_ms=now_ms)
    )
    return done.rowcount == 1


async def delete_over(tx: Tx, *, before_ms: int) -> bool:
    """Delete some closures that were over before this fleet time; whether there may be more."""
    is_over = or_(closures.c.lifted_ms < before_ms, closures.c.until_ms < before_ms)
    some = select(closures.c.closure_id).where(is_over).limit(_DELETED_TOGETHER)
    deleted = await tx.execute(delete(closures).where(closures.c.closure_id.in_(some)))
    return deleted.rowcount == _DELETED_TOGETHER


async def get(connection: AsyncConnection, closure_id: ClosureId) -> Closure | None:
    """A closure, also after it was lifted."""
    found = await connection.execute(select(closures).where(closures.c.closure_id == closure_id))
    row = found.one_or_none()
    return None if row is None else _closure(row)


async def page(
    connection: AsyncConnection, shown: ClosureFilter, *, after: str, limit: int
) -> list[Closure]:
    """Closures in order of their ids, which is the order in which they were made."""
    query = (
        select(closures)
        .where(closures.c.kind == shown.kind, closures.c.closure_id > after)
        .order_by(closures.c.closure_id)
        .limit(limit)
    )
    for column, value in (
        (closures.c.station_id, shown.station_id),
        (closures.c.pad, shown.pad),
        (closures.c.to_station_id, shown.to_station_id),
    ):
        if value is not None:
            query = query.where(column == value)
    if shown.lasting_beyond_ms is not None:
        query = query.where(
            closures.c.lifted_ms.is_(None),
            or_(closures.c.until_ms.is_(None), closures.c.until_ms > shown.lasting_beyond_ms),
        )
    return [_closure(row) for row in await connection.execute(query)]


async def page_in_span(
    connection: AsyncConnection, span: Span, *, after: str, limit: int
) -> list[Closure]:
    """The closures of every kind that were or will be in force in the span, by their ids."""
    columns = closures.c
    found = await connection.execute(
        select(closures)
        .where(
            columns.closure_id > after,
            columns.from_ms < span.end_ms,
            or_(columns.until_ms.is_(None), columns.until_ms > span.start_ms),
            or_(columns.lifted_ms.is_(None), columns.lifted_ms > span.start_ms),
        )
        .order_by(columns.closure_id)
        .limit(limit)
    )
    return [_closure(row) for row in found]


async def outages(
    connection: AsyncConnection, *, at_ms: int, station_id: StationId | None = None
) -> list[Closure]:
    """The pads that are out of order at a moment, everywhere or at one station."""
    if station_id is None:
        found = await connection.execute(_OUTAGES, {"at_ms": at_ms})
    else:
        found = await connection.execute(_OUTAGES_AT, {"at_ms": at_ms, "station_id": station_id})
    return [_closure(row) for row in found]


async def not_over(connection: AsyncConnection, *, at_ms: int) -> list[Closure]:
    """All closures that are in force at a moment or begin later, in the order of their ids."""
    found = await connection.execute(_NOT_OVER, {"at_ms": at_ms})
    return [_closure(row) for row in found]


async def closed_stations(
    connection: AsyncConnection, network_id: NetworkId, *, at_ms: int
) -> frozenset[StationId]:
    """The stations of a network that are closed at a moment."""
    selection = {"network_id": network_id, "at_ms": at_ms}
    found = await connection.execute(_CLOSED_STATIONS, selection)
    return frozenset(found.scalars())


async def ground_stops(connection: AsyncConnection, *, at_ms: int) -> list[Closure]:
    """The ground stops that are in force at a moment."""
    found = await connection.execute(_GROUND_STOPS, {"at_ms": at_ms})
    return [_closure(row) for row in found]


async def stations_between(
    connection: AsyncConnection, south: float, north: float, *, network_id: NetworkId | None
) -> dict[StationId, Position]:
    """Positions of the stations between two parallels, in degrees, by station id.

    Only of one network, or of all networks for None.
    """
    query = select(stations.c.station_id, stations.c.longitude_deg, stations.c.latitude_deg).where(
        stations.c.latitude_deg.between(south, north)
    )
    if network_id is not None:
        query = query.where(stations.c.network_id == network_id)
    found = await connection.execute(query)
    return {row.station_id: Position(row.longitude_deg, row.latitude_deg) for row in found}


def _closure(row: Row[Any]) -> Closure:  # a row of closures
    area = None if row.area is None else Area.read(row.area)
    return Closure(**{**row._mapping, "area": area})


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


async def networks_in_weather(connection: AsyncConnection) -> list[NetworkId]:
    """The networks that have a forecast, or drones on missions, which measure the air."""
    flown = select(missions.c.network_id).where(is_live)
    found = await connection.execute(select(forecasts.c.network_id).union(flown))
    return sorted(found.scalars())


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
