"""The SQL of thinning: a piece of one drone's rows, of which each is a transaction."""

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

#: Rows of a piece, about.
PIECE: Final = 500
_NEVER_MS: Final = 2**62


async def next_drone(connection: AsyncConnection, *, after: str) -> DroneId | None:
    """The first drone after this one, by id, of which anything is kept."""
    found = [(await connection.execute(each, {"about": after})).scalar() for each in _NEXT]
    return min((DroneId(one) for one in found if one is not None), default=None)


async def is_registered(connection: AsyncConnection, drone_id: DroneId) -> bool:
    """Whether there is such a drone."""
    return (await connection.execute(_REGISTERED, {"about": drone_id})).scalar() is not None


async def thin(tx: Tx, drone_id: DroneId, *, heard_before_ms: int) -> bool:
    """Put minutes in the place of a piece of a drone's samples; whether there may be more.

    Only whole minutes, and one that is kept already stays as it is: so replicas that do the same
    at the same time do it once.
    """
    until_ms = await _piece_until(tx, telemetry_samples, drone_id, heard_before_ms)
    if until_ms is None:
        return False
    piece = {"about": drone_id, "until_ms": until_ms}
    await tx.execute(_KEEP_MINUTES, piece)
    return (await tx.execute(_FORGET[telemetry_samples], piece)).rowcount > 0


async def forget_minutes(tx: Tx, drone_id: DroneId, *, heard_before_ms: int) -> bool:
    """Forget a piece of a drone's minutes; whether there may be more."""
    return await _forget(tx, telemetry_minutes, drone_id, heard_before_ms)


async def forget_all(tx: Tx, drone_id: DroneId) -> bool:
    """Forget a piece of all that a drone measured; whether there may be more."""
    forgotten = [await _forget(tx, table, drone_id, _NEVER_MS) for table in _TABLES]
    return any(forgotten)


async def _forget(tx: Tx, table: Table, drone_id: DroneId, heard_before_ms: int) -> bool:
    until_ms = await _piece_until(tx, table, drone_id, heard_before_ms)
    if until_ms is None:
        return False
    piece = {"about": drone_id, "until_ms": until_ms}
    return (await tx.execute(_FORGET[table], piece)).rowcount > 0


async def _piece_until(tx: Tx, table: Table, drone_id: DroneId, heard_before_ms: int) -> int | None:
    """Where the first rows end that are all stale: whole minutes, and about `PIECE` of them."""
    asked = {"about": drone_id, "stale_ms": heard_before_ms, "piece": PIECE}
    ends = (await tx.execute(_ENDS[table], asked)).one()
    if ends.first_ms is None:
        return None
    limits = [end for end in (ends.fresh_ms, ends.piece_ms) if end is not None]
    first_ms = ends.first_ms - ends.first_ms % MINUTE_MS
    until_ms = min(limits, default=_NEVER_MS)
    until_ms -= until_ms % MINUTE_MS
    if until_ms > first_ms:
        return until_ms
    # More rows than a piece in one minute go together, once all of them are stale.
    whole_ms = first_ms + MINUTE_MS
    return whole_ms if ends.fresh_ms is None or ends.fresh_ms >= whole_ms else None


def _ends_of(table: Table) -> Select[Any]:
    """The first of a drone's rows, the first that is not stale, and the first after a piece."""
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


def _keep_minutes() -> Insert:
    # In order, so that of replicas which do the same none waits for the other.
    rows = minutes_of_samples(telemetry_samples.c.at_ms < UNTIL)
    names = [column.name for column in rows.selected_columns]
    # SQLite's compiler takes it as it is: both spell ON CONFLICT the same.
    return postgresql.insert(telemetry_minutes).from_select(names, rows).on_conflict_do_nothing()


# Statements are made once: to make one takes as long as to run it.

_TABLES: Final = (telemetry_samples, telemetry_minutes)
_KEEP_MINUTES: Final = _keep_minutes()
_ENDS: Final = {table: _ends_of(table) for table in _TABLES}
_FORGET: Final = {
    table: delete(table).where(table.c.drone_id == ABOUT, table.c.at_ms < UNTIL)
    for table in _TABLES
}
_NEXT: Final = [
    select(func.min(table.c.drone_id)).where(table.c.drone_id > ABOUT) for table in _TABLES
]
_REGISTERED: Final = select(drones.c.drone_id).where(drones.c.drone_id == ABOUT)
