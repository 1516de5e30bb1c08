"""Rows as PostgreSQL takes them: one array for each column.

So a statement stays the same however many rows it is about.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from sqlalchemy import Table, bindparam, func
from sqlalchemy.dialects import postgresql
from sqlalchemy.sql.selectable import TableValuedAlias
from sqlalchemy.types import TypeEngine, UserDefinedType

_POSTGRESQL: Final = postgresql.dialect()  # type: ignore[no-untyped-call]


def rows_given(name: str, table: Table, columns: Sequence[str]) -> TableValuedAlias:
    """Rows with some columns of a table, as a statement finds them in the arrays of `name`."""
    arrays = (
        bindparam(f"{name}_{column}", type_=_Column(table.c[column].type)) for column in columns
    )
    return func.unnest(*arrays).table_valued(*columns, name=name).render_derived()


def arrays_of(name: str, rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """The parameters for these rows, one at least, which have the same columns.

    Any: a row may hold whatever its columns take.
    """
    return {f"{name}_{column}": [row[column] for row in rows] for column in rows[0]}


class _Column(UserDefinedType[Any]):
    """Values of one type as the driver takes them: SQLAlchemy's own array looks at each of them."""

    cache_ok = True
    render_bind_cast = True

    def __init__(self, of: TypeEngine[Any]) -> None:
        self.of = of

    def get_col_spec(self, **_: Any) -> str:
        """Any: what SQLAlchemy tells a type about its column."""
        return f"{self.of.compile(dialect=_POSTGRESQL)}[]"
