"""The archive: past rows of a service as Parquet files for analysts.

There is a file for each table and day. All days are written that are over and have no file yet.
"""

import os
from collections.abc import AsyncIterator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Final

from sqlalchemy import (
    Boolean,
    Column,
    ColumnElement,
    Double,
    FromClause,
    Integer,
    LargeBinary,
    Select,
    Table,
    select,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.json_model import JsonModel
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import InvalidSettings
from skyway.runtime.sql.connection import each_row
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms, ms_to_moment

#: A day, in milliseconds.
DAY_MS: Final = 86_400_000


@dataclass(frozen=True, slots=True)
class ArchivedTable:
    """A table whose rows are archived.

    Parameters
    ----------
    day_ms
        The moment that puts a row into a day, ms since 1970; a moment in another table for parts.
    source
        The table, joined with the table of `day_ms`.
    where
        Which rows are archived: those that change no more.
    hidden
        Names of columns that are left out: how services share work.
    """

    table: Table
    day_ms: ColumnElement[int]
    source: FromClause
    where: ColumnElement[bool]
    hidden: frozenset[str] = frozenset()

    @property
    def is_of_wall_time(self) -> bool:
        """Whether the days are days of wall time, and not of fleet time."""
        return str(getattr(self.day_ms, "name", "")).endswith("_wall_ms")

    def columns(self) -> Iterator[Column[Any]]:
        """The archived columns; any: columns have every type."""
        return (each for each in self.table.c if each.name not in self.hidden)

    def days(self, *, before: int) -> Select[int]:
        """The numbers of the days before a day that have rows; day 0 is 1970-01-01."""
        day = (self.day_ms - self.day_ms % DAY_MS).label("begins_ms")
        of_past = select(day).select_from(self.source)
        return of_past.where(self.where, self.day_ms < before * DAY_MS).distinct().order_by(day)

    def rows(self, *, begins_ms: int) -> Select[*tuple[Any, ...]]:
        """The rows of the day that begins at this moment, in the order of their keys."""
        of_day = select(*self.columns()).select_from(self.source)
        ends_ms = begins_ms + DAY_MS
        is_of_day = (self.day_ms >= begins_ms) & (self.day_ms < ends_ms)
        return of_day.where(self.where, is_of_day).order_by(*self.table.primary_key)


#: Rows that are in memory at a time, and in one group of the file.
_ROWS_IN_GROUP: Final = 10_000


async def write_parquet(
    path: Path, columns: Iterable[Column[Any]], rows: AsyncIterator[Sequence[Any]]
) -> int:
    """Write a file of these columns; how many rows it has. Any: columns have every type.

    Raises
    ------
    InvalidSettings
        PyArrow is not installed.
    """
    try:
        import pyarrow
        from pyarrow.parquet import ParquetWriter
    except ImportError as error:
        raise InvalidSettings("the archive needs `pip install 'skyway[archive]'`") from error
    schema = pyarrow.schema([(each.name, _arrow_type(each)) for each in columns])
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".unfinished")
    count = 0
    with ParquetWriter(unfinished, schema, compression="zstd") as writer:
        group: list[Sequence[Any]] = []
        async for row in rows:
            group.append(row)
            count += 1
            if len(group) == _ROWS_IN_GROUP:
                writer.write_table(_table(schema, group))
                group = []
        if group:
            writer.write_table(_table(schema, group))
    _sync(unfinished)
    unfinished.rename(path)
    return count


def _table(schema: Any, rows: Sequence[Sequence[Any]]) -> Any:  # PyArrow has no types
    import pyarrow

    columns = zip(*rows, strict=True)
    arrays = [
        pyarrow.array(values, type=each.type) for values, each in zip(columns, schema, strict=True)
    ]
    return pyarrow.Table.from_arrays(arrays, schema=schema)


def _arrow_type(column: Column[Any]) -> Any:  # PyArrow has no types
    import pyarrow

    if isinstance(column.type, Boolean):
        return pyarrow.bool_()
    if isinstance(column.type, Integer):
        return pyarrow.int64()
    if isinstance(column.type, Double):
        return pyarrow.float64()
    return pyarrow.binary() if isinstance(column.type, LargeBinary) else pyarrow.string()


def _sync(path: Path) -> None:
    """Wait until the file is on disk: rows may be deleted from the database afterwards."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


#: How long after its end a day is written: what is late still belongs to it.
_LATE: Final = timedelta(hours=1)


class WrittenDay(JsonModel):
    """A file that was written."""

    table: str
    day: str
    rows: int


@dataclass(frozen=True, slots=True)
class Export:
    """Writes the archive of one database below a folder, read at one moment."""

    db: Database
    clock: FleetClock
    folder: Path

    async def write(self, tables: Sequence[ArchivedTable]) -> list[WrittenDay]:
        """Write each day that is over and has no file; a file that exists is never changed.

        Rows of that day may have been deleted from the database since the file was written.
        """
        written: list[WrittenDay] = []
        async with self.db.survey() as connection:
            for archived in tables:
                for begins_ms in await self._days(connection, archived):
                    day = ms_to_moment(begins_ms).date().isoformat()
                    name = archived.table.name
                    path = self.folder / name / f"{day}.parquet"
                    if not path.exists():
                        rows = each_row(connection, archived.rows(begins_ms=begins_ms))
                        count = await write_parquet(path, archived.columns(), rows)
                        written.append(WrittenDay(table=name, day=day, rows=count))
        return written

    async def _days(self, connection: AsyncConnection, archived: ArchivedTable) -> list[int]:
        """When each of the days begins that are over, ms since 1970."""
        now = self.clock.wall_now() if archived.is_of_wall_time else self.clock.now()
        today = moment_to_ms(_earlier(now)) // DAY_MS
        days = await connection.execute(archived.days(before=today))
        return [row.begins_ms for row in days]


def _earlier(now: datetime) -> datetime:
    return now - _LATE
