"""All SQL that adds samples of telemetry, and that reads telemetry by time."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from operator import itemgetter
from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    ColumnElement,
    Integer,
    Select,
    Table,
    Text,
    and_,
    bindparam,
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
from skyway_provider_registry.tables import telemetry_minutes, telemetry_samples

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
