"""All SQL of telemetry: adds samples, reads them by time, and replaces old ones by minutes."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from operator import itemgetter
from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    ColumnElement,
    Insert,
    Integer,
    Select,
    Table,
    Text,
    and_,
    bindparam,
    delete,
    func,
    literal_column,
    select,
)
from sqlalchemy.dialects import postgresql
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.drone_report import Telemetry
from skyway.ids import DroneId
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_provider_registry.tables import drones, telemetry_minutes, telemetry_samples

MINUTE_MS: Final = 60_000

_MEASURED: Final = ("soc", "power_w", "speed_mps")
_PLACE: Final = ("longitude_deg", "latitude_deg")

_samples = telemetry_samples.c
ABOUT: Final = bindparam("about", type_=Text)
_FROM: Final = bindparam("from_ms", type_=BigInteger)
UNTIL: Final = bindparam("until_ms", type_=BigInteger)
_MOST: Final = bindparam("most", type_=Integer)


@dataclass(frozen=True, slots=True)
class ReceivedSample:
    """A drone's sample, and the wall ms at which it was received."""

    drone_id: DroneId
    sample: Telemetry
    wall_ms: int


@dataclass(frozen=True, slots=True)
class Span:
    """The period to read, `until_ms` excluded, and the most rows to read."""

    from_ms: int
    until_ms: int
    most: int


async def add(tx: Tx, samples: Sequence[ReceivedSample]) -> None:
    """Store samples; each drone and moment has one row, even when several replicas store it."""
    rows = [
        {
            "drone_id": received.drone_id,
            "at_ms": moment_to_ms(received.sample.at),
            "heard_wall_ms": received.wall_ms,
            "longitude_deg": received.sample.position[0],
            "latitude_deg": received.sample.position[1],
            "soc": received.sample.soc,
            "power_w": received.sample.power_w,
            "speed_mps": received.sample.speed_mps,
            "voltage_v": received.sample.voltage_v,
            "temperature_c": received.sample.temperature_c,
            "range_m": received.sample.range_m,
        }
        for received in samples
    ]
    # The same order in all replicas, so that two of them cannot deadlock.
    rows.sort(key=itemgetter("drone_id", "at_ms"))
    await tx.execute(_ADD, rows)


async def samples_between(
    connection: AsyncConnection, drone_id: DroneId, span: Span
) -> Sequence[AnyRow]:
    """A drone's first samples of this period."""
    return await _read(connection, _SAMPLES, drone_id, span)


async def minutes_between(
    connection: AsyncConnection, drone_id: DroneId, span: Span
) -> Sequence[AnyRow]:
    """A drone's first minutes of this period: stored minutes, and minutes of its samples."""
    # In this order, samples that are thinned between the two statements are found twice. In the
    # other order they would be missed.
    fresh = await _read(connection, _FRESH_MINUTES, drone_id, span)
    stored = await _read(connection, _STORED_MINUTES, drone_id, span)
    found = {row.at_ms: row for row in (*fresh, *stored)}
    return [found[at_ms] for at_ms in sorted(found)[: span.most]]


async def has_all_samples(connection: AsyncConnection, drone_id: DroneId, span: Span) -> bool:
    """Whether no sample of this period was thinned, and there are at most `most` samples."""
    thinned = await _read(connection, _STORED_MINUTES, drone_id, replace(span, most=1))
    return not (thinned or await _read(connection, _MORE_SAMPLES, drone_id, span))


async def _read(
    connection: AsyncConnection, statement: Select[Any], drone_id: DroneId, span: Span
) -> Sequence[AnyRow]:
    parameters = {"about": drone_id, **asdict(span)}
    rows: Sequence[AnyRow] = (await connection.execute(statement, parameters)).all()
    return rows


def moments_of(table: Table, *conditions: ColumnElement[bool]) -> Select[Any]:
    """The moments of a drone's rows, in order."""
    of_drone = table.c.drone_id == ABOUT
    return select(table.c.at_ms).where(of_drone, *conditions).order_by(table.c.at_ms)


def minutes_of_samples(*conditions: ColumnElement[bool]) -> Select[Any]:
    """A drone's samples as rows of `telemetry_minutes`, with the last position of each."""
    minute = literal_column(str(MINUTE_MS), BigInteger)
    chosen = (
        select(telemetry_samples, (_samples.at_ms - _samples.at_ms % minute).label("minute_ms"))
        .where(_samples.drone_id == ABOUT, *conditions)
        .subquery("chosen")
        .c
    )
    by_minute = (
        select(
            chosen.minute_ms.label("at_ms"),
            func.max(chosen.at_ms).label("last_ms"),
            func.max(chosen.heard_wall_ms).label("heard_wall_ms"),
            func.count().label("samples"),
            *(
                function(chosen[name]).label(f"{prefix}{name}")
                for name in _MEASURED
                for prefix, function in (("", func.avg), ("min_", func.min), ("max_", func.max))
            ),
        )
        .group_by(chosen.minute_ms)
        .subquery("by_minute")
    )
    last = telemetry_samples.alias("last")
    return (
        select(
            last.c.drone_id,
            *(last.c[name] for name in _PLACE),
            *(column for column in by_minute.c if column.name != "last_ms"),
        )
        .join_from(by_minute, last, last.c.at_ms == by_minute.c.last_ms)
        .where(last.c.drone_id == ABOUT)
        .order_by(by_minute.c.at_ms)
    )


def _first_rows(table: Table) -> Select[Any]:
    """A drone's first rows of a period, in order."""
    in_period = and_(table.c.drone_id == ABOUT, table.c.at_ms >= _FROM, table.c.at_ms < UNTIL)
    return select(table).where(in_period).order_by(table.c.at_ms).limit(_MOST)


# Statements are built once: building a statement takes as long as running it.

_ADD: Final = postgresql.insert(telemetry_samples).on_conflict_do_nothing()
_SAMPLES: Final = _first_rows(telemetry_samples)
_STORED_MINUTES: Final = _first_rows(telemetry_minutes)
_IN_PERIOD: Final = (_samples.at_ms >= _FROM, _samples.at_ms < UNTIL)
_MORE_SAMPLES: Final = moments_of(telemetry_samples, *_IN_PERIOD).limit(1).offset(_MOST)
_FRESH_MINUTES: Final = minutes_of_samples(*_IN_PERIOD).limit(_MOST)


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
