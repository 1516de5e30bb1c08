"""A bulk write as one statement for PostgreSQL, which is a transaction by itself.

The statement sees the database as it was before, and checks foreign keys after all rows are
written. The other parts begin after the guard has found and locked its row.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, Final, NamedTuple, Self

from sqlalchemy import (
    CTE,
    ColumnElement,
    FromClause,
    Insert,
    Select,
    Table,
    Update,
    and_,
    bindparam,
    exists,
    func,
    insert,
    select,
    true,
    update,
)
from sqlalchemy.dialects import postgresql
from sqlalchemy.sql.dml import ReturningUpdate
from sqlalchemy.types import TypeEngine, UserDefinedType

from skyway.runtime.sql.bulk_write import (
    BulkWrite,
    DerivedAddition,
    DerivedRows,
    Row,
    RowUpdates,
    Run,
)

_POSTGRESQL: Final = postgresql.dialect()  # type: ignore[no-untyped-call]  # it has no types


async def run_as_one(write: BulkWrite, run: Run) -> Sequence[DerivedAddition]:
    """Write it, or raise the guard's error; returns the additions that added rows."""
    is_found, *were_added = (await run(*statement_of(write))).one()
    if write.guard is not None and not is_found:
        raise write.guard.otherwise
    return [each for each, was_added in zip(write.derived, were_added, strict=True) if was_added]


def statement_of(write: BulkWrite) -> tuple[Select[*tuple[Any, ...]], dict[str, Any]]:
    """The statement that writes it, and its parameters. Any: columns have every type."""
    guard = write.guard
    shape = _Shape(
        None if guard is None else guard.statement,
        tuple(map(_UpdateShape.of, write.updates)),
        tuple(_RowsShape.of(table, rows) for table, rows in write.added.items()),
        tuple(each.derived for each in write.derived),
    )
    values = {} if guard is None else dict(guard.values)
    for number, (updated, updates) in enumerate(zip(shape.updates, write.updates, strict=True)):
        values |= updated.rows.parameters(f"update_{number}", updates.rows)
        values |= {f"where_{number}_{name}": value for name, value in updates.where.items()}
    for added, rows in zip(shape.added, write.added.values(), strict=True):
        values |= added.parameters(_new(added.table), rows)
    for each in write.derived:
        values |= each.values
    return _statement(shape), values


class _RowsShape(NamedTuple):
    """What the statement depends on: columns of a table, and whether there is a single row.

    The statement is the same for every number of rows above one. A single row is given value by
    value, several rows as an array for each column. Arrays cost both sides more, and most blocks
    write a single row to most tables.
    """

    table: Table
    columns: tuple[str, ...]
    is_single: bool

    @classmethod
    def of(cls, table: Table, rows: Sequence[Row]) -> Self:
        """The shape of these rows: one at least, all with the same columns."""
        return cls(table, tuple(rows[0]), len(rows) == 1)

    def source(self, name: str) -> FromClause:
        """The rows, as the statement finds them in the parameters of this name."""
        parameters = [
            bindparam(
                f"{name}_{column}", type_=_DriverValue(self.table.c[column].type, self.is_single)
            )
            for column in self.columns
        ]
        if self.is_single:
            labelled = zip(self.columns, parameters, strict=True)
            return select(*(value.label(column) for column, value in labelled)).subquery(name)
        return func.unnest(*parameters).table_valued(*self.columns, name=name).render_derived()

    def parameters(self, name: str, rows: Sequence[Row]) -> dict[str, Any]:
        """The parameters for these rows. Any: columns have every type."""
        if self.is_single:
            return {f"{name}_{column}": value for column, value in rows[0].items()}
        return {f"{name}_{column}": [row[column] for row in rows] for column in self.columns}


class _UpdateShape(NamedTuple):
    """What the statement depends on in the updates of one table."""

    rows: _RowsShape
    where: tuple[str, ...]
    key: str
    increments: tuple[str, ...]

    @classmethod
    def of(cls, updates: RowUpdates) -> Self:
        rows = _RowsShape.of(updates.table, updates.rows)
        return cls(rows, tuple(updates.where), updates.key, updates.increments)


class _Shape(NamedTuple):
    """What the statement depends on: blocks of the same shape share their statement."""

    guard: ReturningUpdate[*tuple[Any, ...]] | None  # Any: the column may have every type
    updates: tuple[_UpdateShape, ...]
    added: tuple[_RowsShape, ...]
    derived: tuple[DerivedRows, ...]


@lru_cache(maxsize=200)  # a service has few kinds of blocks
def _statement(shape: _Shape) -> Select[*tuple[Any, ...]]:
    """Any: the columns that say what was done belong to no table."""
    guard = None if shape.guard is None else shape.guard.cte("guard")
    # This part reads no table, so the server evaluates it before it reads any table.
    condition = true() if guard is None else exists().select_from(guard)
    sources = {each.source for each in shape.derived}
    written: dict[Table, CTE] = {}
    parts: list[CTE] = []

    def note(part: Update | Insert, table: Table, name: str) -> None:
        returning = part.returning(*table.columns) if table in sources else part
        written[table] = returning.cte(name)
        parts.append(written[table])

    for number, updates in enumerate(shape.updates):
        note(_update(updates, number, condition), updates.rows.table, f"updated_{number}")
    for number, added in enumerate(shape.added):
        table = added.table
        rows = select(added.source(_new(table))).where(condition)
        new = insert(table).from_select(added.columns, rows, include_defaults=False)
        note(new, table, f"added_{number}")
    derived = [
        _insert_derived(each, written).cte(f"derived_{number}")
        for number, each in enumerate(shape.derived)
    ]
    done = (exists().select_from(each).label(each.name) for each in derived)
    return select(condition.label("is_found"), *done).add_cte(*parts)


def _update(updates: _UpdateShape, number: int, condition: ColumnElement[bool]) -> Update:
    table = updates.rows.table
    new = updates.rows.source(f"update_{number}")
    conditions = [table.c[name] == bindparam(f"where_{number}_{name}") for name in updates.where]
    conditions.append(table.c[updates.key] == new.c[updates.key])
    values = {
        name: table.c[name] + new.c[name] if name in updates.increments else new.c[name]
        for name in updates.rows.columns
        if name != updates.key
    }
    return update(table).where(and_(*conditions, condition)).values(values)


def _insert_derived(derived: DerivedRows, written: Mapping[Table, CTE]) -> Insert:
    """No condition is needed: without written rows there is nothing to derive rows from."""
    query = derived.query(written[derived.source])
    columns = [each.name for each in query.selected_columns]
    new = insert(derived.into).from_select(columns, query, include_defaults=False)
    return new.returning(*derived.into.primary_key)


def _new(table: Table) -> str:
    return f"new_{table.name}"


class _DriverValue(UserDefinedType[Any]):
    """Values as the driver takes them: SQLAlchemy's own array type looks at each value."""

    cache_ok = True
    render_bind_cast = True

    def __init__(self, of: TypeEngine[Any], is_single: bool) -> None:
        self.of = of
        self.is_single = is_single

    def get_col_spec(self, **_: Any) -> str:
        """Any: options that SQLAlchemy passes to a type."""
        name = self.of.compile(dialect=_POSTGRESQL)
        return name if self.is_single else f"{name}[]"
