"""What a block has declared as statements for SQLite, each in its turn."""

from collections.abc import Sequence
from functools import lru_cache

from sqlalchemy import Insert, Table, Update, bindparam, insert, update

from skyway.runtime.sql.declared import Change, Consequence, Declared, Following, Row, Run


async def write_in_turn(declared: Declared, run: Run) -> Sequence[Following]:
    """Write it, or raise what its guard says; which consequences there were."""
    guard = declared.guard
    if guard is not None and not (await run(guard.statement, guard.values)).all():
        raise guard.otherwise
    for change in declared.changes:
        await run(*_changing(change))
    for table, rows in declared.added.items():
        await run(table.insert(), rows)
    done = [
        (each, await run(_following(each.consequence), each.values)) for each in declared.following
    ]
    return [each for each, added in done if added.rowcount]


def _changing(change: Change) -> tuple[Update, Sequence[Row]]:
    """The statement that changes rows, and its parameters for each of them."""
    columns = tuple(change.rows[0])
    statement = _update(change.table, tuple(change.this), columns, change.key, change.counted)
    this = {f"this_{name}": value for name, value in change.this.items()}
    return statement, [
        {**this, **{f"new_{name}": value for name, value in row.items()}} for row in change.rows
    ]


@lru_cache(maxsize=200)  # making it takes longer than running it
def _update(
    table: Table,
    this: tuple[str, ...],
    columns: tuple[str, ...],
    key: str,
    counted: tuple[str, ...],
) -> Update:
    found = [table.c[name] == bindparam(f"this_{name}") for name in this]
    found.append(table.c[key] == bindparam(f"new_{key}"))
    new = {name: bindparam(f"new_{name}", type_=table.c[name].type) for name in columns}
    values = {
        name: table.c[name] + value if name in counted else value
        for name, value in new.items()
        if name != key
    }
    return update(table).where(*found).values(values)


@lru_cache(maxsize=100)
def _following(consequence: Consequence) -> Insert:
    """The statement that adds what follows from rows that were written just now."""
    selected = consequence.selected(consequence.of)
    columns = [each.name for each in selected.selected_columns]
    return insert(consequence.into).from_select(columns, selected, include_defaults=False)
