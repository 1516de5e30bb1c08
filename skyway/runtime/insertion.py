"""Rows of several tables, added by one statement: each one to a server is a journey of its own.

PostgreSQL takes each column of each table as one array, so that the statement stays the same
however many rows there are, and looks at foreign keys when all rows are there. SQLite, to which
the way is short, takes table after table.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, Final

from sqlalchemy import Executable, Insert, Table, bindparam, func, insert, select
from sqlalchemy.dialects import postgresql
from sqlalchemy.types import TypeEngine, UserDefinedType

_POSTGRESQL: Final = postgresql.dialect()  # type: ignore[no-untyped-call]

#: Rows by their tables; those of one table have the same columns.
Rows = Mapping[Table, Sequence[Mapping[str, Any]]]


def insertion_of(rows: Rows) -> tuple[Executable, dict[str, list[Any]]]:
    """The statement that adds rows to PostgreSQL, one at least, and its parameters."""
    columns_of = {table: tuple(of_table[0]) for table, of_table in rows.items()}
    parameters = {
        _parameter(table, column): [row[column] for row in rows[table]]
        for table, columns in columns_of.items()
        for column in columns
    }
    return _insertion(*columns_of.items()), parameters


@lru_cache(maxsize=100)  # a service has few kinds of transactions
def _insertion(*columns_of: tuple[Table, tuple[str, ...]]) -> Executable:
    *others, last = (_from_arrays(table, columns) for table, columns in columns_of)
    return last.add_cte(*(each.cte(f"added_{number}") for number, each in enumerate(others)))


def _from_arrays(table: Table, columns: Sequence[str]) -> Insert:
    arrays = (
        bindparam(_parameter(table, column), type_=_Column(table.c[column].type))
        for column in columns
    )
    rows = func.unnest(*arrays).table_valued(*columns, name=f"new_{table.name}").render_derived()
    return insert(table).from_select(columns, select(rows), include_defaults=False)


def _parameter(table: Table, column: str) -> str:
    return f"{table.name}_{column}"


class _Column(UserDefinedType[Any]):
    """Values of one type as the driver takes them: SQLAlchemy's own array looks at each of them."""

    cache_ok = True
    render_bind_cast = True

    def __init__(self, of: TypeEngine[Any]) -> None:
        self.of = of

    def get_col_spec(self, **_: Any) -> str:
        """Any: what SQLAlchemy tells a type about its column."""
        return f"{self.of.compile(dialect=_POSTGRESQL)}[]"
