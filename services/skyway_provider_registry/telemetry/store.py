"""The SQL of telemetry: what is heard is added, and read by time."""

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
class HeardSample:
    """A drone's sample, and the wall ms at which it was heard."""

    drone_id: DroneId
    sample: Telemetry
    wall_ms: int


@dataclass(frozen=True, slots=True)
class Span:
    """A time that is read, from the first moment to before the last, and the most rows of it."""

    from_ms: int
    until_ms: int
    most: int


async def add(tx: Tx, samples: Sequence[HeardSample]) -> None:
    """Keep samples; of one drone and moment there is one, whoever hears it and however often."""
    rows = [
        {
            "drone_id": heard.drone_id,
            "at_ms": moment_to_ms(heard.sample.at),
            "heard_wall_ms": heard.wall_ms,
            "longitude_deg": heard.sample.position[0],
            "latitude_deg": heard.sample.position[1],
            "soc": heard.sample.soc,
            "power_w": heard.sample.power_w,
            "speed_mps": heard.sample.speed_mps,
            "voltage_v": heard.sample.voltage_v,
            "temperature_c": heard.sample.temperature_c,
            "range_m": heard.sample.range_m,
        }
        for heard in samples
    ]
    # In the same order everywhere, so that two replicas cannot wait for each other.
    rows.sort(key=itemgetter("drone_id", "at_ms"))
    await tx.execute(_ADD, rows)


async def samples_between(
    connection: AsyncConnection, drone_id: DroneId, span: Span
) -> Sequence[AnyRow]:
    """A drone's first samples of this time."""
    return await _read(connection, _SAMPLES, drone_id, span)


async def minutes_between(
    connection: AsyncConnection, drone_id: DroneId, span: Span
) -> Sequence[AnyRow]:
    """A drone's first minutes of this time: those that are kept, and those of its samples."""
    # In this order: samples that are thinned between the two statements are then found twice.
    fresh = await _read(connection, _FRESH_MINUTES, drone_id, span)
    kept = await _read(connection, _KEPT_MINUTES, drone_id, span)
    found = {row.at_ms: row for row in (*fresh, *kept)}
    return [found[at_ms] for at_ms in sorted(found)[: span.most]]


async def has_all_samples(connection: AsyncConnection, drone_id: DroneId, span: Span) -> bool:
    """Whether no sample of this time was thinned, and there are at most `most`."""
    thinned = await _read(connection, _KEPT_MINUTES, drone_id, replace(span, most=1))
    return not (thinned or await _read(connection, _MORE_SAMPLES, drone_id, span))


async def _read(
    connection: AsyncConnection, statement: Select[Any], drone_id: DroneId, span: Span
) -> Sequence[AnyRow]:
    asked = {"about": drone_id, **asdict(span)}
    rows: Sequence[AnyRow] = (await connection.execute(statement, asked)).all()
    return rows


def moments_of(table: Table, *conditions: ColumnElement[bool]) -> Select[Any]:
    """The moments of a drone's rows in order."""
    of_drone = table.c.drone_id == ABOUT
    return select(table.c.at_ms).where(of_drone, *conditions).order_by(table.c.at_ms)


def minutes_of_samples(*conditions: ColumnElement[bool]) -> Select[Any]:
    """A drone's samples as rows of `telemetry_minutes`, each with the last place of its minute."""
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
    """A drone's first rows of a time, in order."""
    in_time = and_(table.c.drone_id == ABOUT, table.c.at_ms >= _FROM, table.c.at_ms < UNTIL)
    return select(table).where(in_time).order_by(table.c.at_ms).limit(_MOST)


# Statements are made once: to make one takes as long as to run it.

_ADD: Final = postgresql.insert(telemetry_samples).on_conflict_do_nothing()
_SAMPLES: Final = _first_rows(telemetry_samples)
_KEPT_MINUTES: Final = _first_rows(telemetry_minutes)
_IN_TIME: Final = (_samples.at_ms >= _FROM, _samples.at_ms < UNTIL)
_MORE_SAMPLES: Final = moments_of(telemetry_samples, *_IN_TIME).limit(1).offset(_MOST)
_FRESH_MINUTES: Final = minutes_of_samples(*_IN_TIME).limit(_MOST)
