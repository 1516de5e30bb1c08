"""Writes the days of a service's tables that are over and have no file yet."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final

from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.json_model import JsonModel
from skyway.runtime.archive.archived_table import DAY_MS, ArchivedTable
from skyway.runtime.archive.parquet_file import write_parquet
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.connection import each_row
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms, ms_to_moment

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
