"""The bulk write of a block: all rows that the block adds and changes at its end, or none.

On PostgreSQL it is one statement (`single_statement`), since each statement is a round trip to the
server. On SQLite, which has no round trips, it is one statement after another.
"""

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from sqlalchemy import (
    Executable,
    FromClause,
    Insert,
    Select,
    Table,
    Update,
    bindparam,
    insert,
    update,
)
from sqlalchemy.engine import CursorResult
from sqlalchemy.sql.dml import ReturningUpdate

#: Column values by name. Any: a column takes values of every type.
Row = Mapping[str, Any]

#: Runs a statement of the block. Any: it returns columns of every type.
Run = Callable[[Executable, Any], Awaitable[CursorResult[*tuple[Any, ...]]]]


@dataclass(frozen=True, slots=True)
class Guard:
    """An UPDATE on which the bulk write depends: if it finds no row, nothing is written.

    Its new values are parameters, and it returns a column of each row that it finds.
    """

    statement: ReturningUpdate[*tuple[Any, ...]]  # Any: the column may have every type
    values: Row
    otherwise: Exception


@dataclass(frozen=True, slots=True)
class RowUpdates:
    """New values of rows, each found by its `key` among the rows with the values of `where`.

    The values of `increments` columns are added to the present ones.
    """

    table: Table
    where: Row
    rows: Sequence[Row]
    key: str
    increments: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class DerivedRows:
    """Rows of one table that are selected from rows which the block writes to another table.

    `query` selects them by the names of their columns. Its argument holds the written rows on
    PostgreSQL, but the whole table on SQLite. So the query must name the rows that it means.
    """

    into: Table
    source: Table
    query: Callable[[FromClause], Select[*tuple[Any, ...]]]  # Any: columns have every type


@dataclass(frozen=True, slots=True)
class DerivedAddition:
    """Derived rows that one block adds, and the callback after the commit if there were any."""

    derived: DerivedRows
    values: Row
    on_added: Callable[[], None] | None


@dataclass(slots=True)
class BulkWrite:
    """Everything that one block writes at its end, in the order in which it is written."""

    guard: Guard | None = None
    updates: list[RowUpdates] = field(default_factory=list)
    #: Rows of one table have the same columns.
    added: dict[Table, list[Row]] = field(default_factory=dict)
    derived: list[DerivedAddition] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self.guard or self.updates or self.added or self.derived)


async def run_one_by_one(write: BulkWrite, run: Run) -> Sequence[DerivedAddition]:
    """Write it on SQLite, or raise the guard's error; returns the additions that added rows."""
    guard = write.guard
    if guard is not None and not (await run(guard.statement, guard.values)).all():
        raise guard.otherwise
    for updates in write.updates:
        await run(*_update_of(updates))
    for table, rows in write.added.items():
        await run(table.insert(), rows)
    done = [(each, await run(_insert_derived(each.derived), each.values)) for each in write.derived]
    return [each for each, result in done if result.rowcount]


def _update_of(updates: RowUpdates) -> tuple[Update, Sequence[Row]]:
    """The statement that changes rows, and its parameters for each of them."""
    columns = tuple(updates.rows[0])
    where = tuple(updates.where)
    statement = _update(updates.table, where, columns, updates.key, updates.increments)
    fixed = {f"where_{name}": value for name, value in updates.where.items()}
    return statement, [
        {**fixed, **{f"new_{name}": value for name, value in row.items()}} for row in updates.rows
    ]


@lru_cache(maxsize=200)  # making a statement takes longer than running it
def _update(
    table: Table,
    where: tuple[str, ...],
    columns: tuple[str, ...],
    key: str,
    increments: tuple[str, ...],
) -> Update:
    conditions = [table.c[name] == bindparam(f"where_{name}") for name in where]
    conditions.append(table.c[key] == bindparam(f"new_{key}"))
    new = {name: bindparam(f"new_{name}", type_=table.c[name].type) for name in columns}
    values = {
        name: table.c[name] + value if name in increments else value
        for name, value in new.items()
        if name != key
    }
    return update(table).where(*conditions).values(values)


@lru_cache(maxsize=100)
def _insert_derived(derived: DerivedRows) -> Insert:
    """The statement that adds rows derived from the rows that were written just now."""
    query = derived.query(derived.source)
    columns = [each.name for each in query.selected_columns]
    return insert(derived.into).from_select(columns, query, include_defaults=False)
