"""All SQL of thinning; each transaction handles a piece of one drone's rows."""

from typing import Any, Final

from sqlalchemy import BigInteger, Insert, Integer, Select, Table, bindparam, delete, func, select
from sqlalchemy.dialects import postgresql
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId
from skyway.runtime.sql.database import Tx
from skyway_provider_registry.tables import drones, telemetry_minutes, telemetry_samples
from skyway_provider_registry.telemetry.store import (
    ABOUT,
    MINUTE_MS,
    UNTIL,
    minutes_of_samples,
    moments_of,
)

#: About how many rows a piece has.
PIECE: Final = 500
_NEVER_MS: Final = 2**62


async def next_drone(connection: AsyncConnection, *, after: str) -> DroneId | None:
    """The first drone after this one, by id, that has telemetry."""
    found = [(await connection.execute(each, {"about": after})).scalar() for each in _NEXT]
    return min((DroneId(one) for one in found if one is not None), default=None)


async def is_registered(connection: AsyncConnection, drone_id: DroneId) -> bool:
    """Whether the drone is registered."""
    return (await connection.execute(_REGISTERED, {"about": drone_id})).scalar() is not None


async def thin(tx: Tx, drone_id: DroneId, *, received_before_ms: int) -> bool:
    """Replace a piece of a drone's samples by minutes; True when there may be more samples.

    Only whole minutes are replaced, and a stored minute is not overwritten. So two replicas that
    thin the same samples store each minute once.
    """
    until_ms = await _piece_until(tx, telemetry_samples, drone_id, received_before_ms)
    if until_ms is None:
        return False
    piece = {"about": drone_id, "until_ms": until_ms}
    await tx.execute(_STORE_MINUTES, piece)
    return (await tx.execute(_DELETE[telemetry_samples], piece)).rowcount > 0


async def delete_minutes(tx: Tx, drone_id: DroneId, *, received_before_ms: int) -> bool:
    """Delete a piece of a drone's old minutes; True when there may be more."""
    return await _delete(tx, telemetry_minutes, drone_id, received_before_ms)


async def delete_all(tx: Tx, drone_id: DroneId) -> bool:
    """Delete a piece of a drone's telemetry; True when there may be more."""
    deleted = [await _delete(tx, table, drone_id, _NEVER_MS) for table in _TABLES]
    return any(deleted)


async def _delete(tx: Tx, table: Table, drone_id: DroneId, received_before_ms: int) -> bool:
    until_ms = await _piece_until(tx, table, drone_id, received_before_ms)
    if until_ms is None:
        return False
    piece = {"about": drone_id, "until_ms": until_ms}
    return (await tx.execute(_DELETE[table], piece)).rowcount > 0


async def _piece_until(
    tx: Tx, table: Table, drone_id: DroneId, received_before_ms: int
) -> int | None:
    """The end of the first piece of old rows: whole minutes, and about `PIECE` rows."""
    parameters = {"about": drone_id, "stale_ms": received_before_ms, "piece": PIECE}
    ends = (await tx.execute(_ENDS[table], parameters)).one()
    if ends.first_ms is None:
        return None
    limits = [end for end in (ends.fresh_ms, ends.piece_ms) if end is not None]
    first_ms = ends.first_ms - ends.first_ms % MINUTE_MS
    until_ms = min(limits, default=_NEVER_MS)
    until_ms -= until_ms % MINUTE_MS
    if until_ms > first_ms:
        return until_ms
    # A minute with more rows than a piece is one piece, once all its rows are old.
    whole_ms = first_ms + MINUTE_MS
    return whole_ms if ends.fresh_ms is None or ends.fresh_ms >= whole_ms else None


def _ends_of(table: Table) -> Select[Any]:
    """A drone's first row, its first row that is not old, and the first row after a piece."""
    fresh = moments_of(table, table.c.heard_wall_ms >= bindparam("stale_ms", type_=BigInteger))
    return select(
        moments_of(table).limit(1).scalar_subquery().label("first_ms"),
        fresh.limit(1).scalar_subquery().label("fresh_ms"),
        moments_of(table)
        .limit(1)
        .offset(bindparam("piece", type_=Integer))
        .scalar_subquery()
        .label("piece_ms"),
    )


def _store_minutes() -> Insert:
    # In order, so that two replicas cannot deadlock.
    rows = minutes_of_samples(telemetry_samples.c.at_ms < UNTIL)
    names = [column.name for column in rows.selected_columns]
    # This also works with SQLite: both dialects write ON CONFLICT in the same way.
    return postgresql.insert(telemetry_minutes).from_select(names, rows).on_conflict_do_nothing()


# Statements are built once: building a statement takes as long as running it.

_TABLES: Final = (telemetry_samples, telemetry_minutes)
_STORE_MINUTES: Final = _store_minutes()
_ENDS: Final = {table: _ends_of(table) for table in _TABLES}
_DELETE: Final = {
    table: delete(table).where(table.c.drone_id == ABOUT, table.c.at_ms < UNTIL)
    for table in _TABLES
}
_NEXT: Final = [
    select(func.min(table.c.drone_id)).where(table.c.drone_id > ABOUT) for table in _TABLES
]
_REGISTERED: Final = select(drones.c.drone_id).where(drones.c.drone_id == ABOUT)
