"""A table as the archive has it: its rows by day, without some columns."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import Column, ColumnElement, FromClause, Select, Table, select

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
