"""All that a block has declared as one statement for PostgreSQL: a transaction of its own.

It sees the database as it was before the block's end, and looks at foreign keys when all rows are
there. What depends on a guard is not begun before the guard has found its row and locked it.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple, Self

from sqlalchemy import (
    CTE,
    ColumnElement,
    Insert,
    Select,
    Table,
    Update,
    and_,
    bindparam,
    exists,
    insert,
    select,
    true,
    update,
)
from sqlalchemy.sql.dml import ReturningUpdate

from skyway.runtime.sql.declared import Change, Consequence, Declared, Following, Run
from skyway.runtime.sql.given import Given


class _Changing(NamedTuple):
    """What changes of one kind have in common."""

    given: Given
    this: tuple[str, ...]
    key: str
    counted: tuple[str, ...]

    @classmethod
    def of(cls, change: Change) -> Self:
        given = Given.of(change.table, change.rows)
        return cls(given, tuple(change.this), change.key, change.counted)


class _Shape(NamedTuple):
    """What blocks of one kind have in common: their statement."""

    guard: ReturningUpdate[*tuple[Any, ...]] | None  # whatever column it returns
    changes: tuple[_Changing, ...]
    added: tuple[Given, ...]
    consequences: tuple[Consequence, ...]


async def write_at_once(declared: Declared, run: Run) -> Sequence[Following]:
    """Write it, or raise what its guard says; which consequences there were."""
    is_expected, *followed = (await run(*statement_of(declared))).one()
    if declared.guard is not None and not is_expected:
        raise declared.guard.otherwise
    return [each for each, was_any in zip(declared.following, followed, strict=True) if was_any]


def statement_of(declared: Declared) -> tuple[Select[*tuple[Any, ...]], dict[str, Any]]:
    """The statement that writes it, and its parameters. Any: whatever columns take."""
    guard = declared.guard
    shape = _Shape(
        None if guard is None else guard.statement,
        tuple(map(_Changing.of, declared.changes)),
        tuple(Given.of(table, rows) for table, rows in declared.added.items()),
        tuple(each.consequence for each in declared.following),
    )
    values = {} if guard is None else dict(guard.values)
    for number, (kind, change) in enumerate(zip(shape.changes, declared.changes, strict=True)):
        values |= kind.given.parameters(f"change_{number}", change.rows)
        values |= {f"this_{number}_{name}": value for name, value in change.this.items()}
    for given, rows in zip(shape.added, declared.added.values(), strict=True):
        values |= given.parameters(_new(given.table), rows)
    for each in declared.following:
        values |= each.values
    return _statement(shape), values


@lru_cache(maxsize=200)  # a service has few kinds of blocks
def _statement(shape: _Shape) -> Select[*tuple[Any, ...]]:
    """Any: the columns that say what was done are of no model."""
    guard = None if shape.guard is None else shape.guard.cte("expected")
    # Asked of nothing that is read, it is answered before anything is.
    condition = true() if guard is None else exists().select_from(guard)
    sources = {each.of for each in shape.consequences}
    written: dict[Table, CTE] = {}
    parts: list[CTE] = []

    def note(part: Update | Insert, table: Table, name: str) -> None:
        returning = part.returning(*table.columns) if table in sources else part
        written[table] = returning.cte(name)
        parts.append(written[table])

    for number, changing in enumerate(shape.changes):
        note(_update(changing, number, condition), changing.given.table, f"changed_{number}")
    for number, given in enumerate(shape.added):
        table = given.table
        rows = select(given.rows(_new(table))).where(condition)
        new = insert(table).from_select(given.columns, rows, include_defaults=False)
        note(new, table, f"added_{number}")
    follows = [
        _insertion(each, written).cte(f"follows_{number}")
        for number, each in enumerate(shape.consequences)
    ]
    done = (exists().select_from(each).label(each.name) for each in follows)
    return select(condition.label("is_expected"), *done).add_cte(*parts)


def _update(changing: _Changing, number: int, condition: ColumnElement[bool]) -> Update:
    table = changing.given.table
    new = changing.given.rows(f"change_{number}")
    found = [table.c[name] == bindparam(f"this_{number}_{name}") for name in changing.this]
    found.append(table.c[changing.key] == new.c[changing.key])
    values = {
        name: table.c[name] + new.c[name] if name in changing.counted else new.c[name]
        for name in changing.given.columns
        if name != changing.key
    }
    return update(table).where(and_(*found, condition)).values(values)


def _insertion(consequence: Consequence, written: Mapping[Table, CTE]) -> Insert:
    """What follows from rows that are not written is not asked for: they are there with these."""
    into = consequence.into
    selected = consequence.selected(written[consequence.of])
    columns = [each.name for each in selected.selected_columns]
    new = insert(into).from_select(columns, selected, include_defaults=False)
    return new.returning(*into.primary_key)


def _new(table: Table) -> str:
    return f"new_{table.name}"
