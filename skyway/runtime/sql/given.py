"""Rows as PostgreSQL is given them: a single one value by value, else an array for each column.

So a statement stays the same however many rows it is about. To read arrays costs both sides more
than to read values, and most blocks write a single row of most tables.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple, Self

from sqlalchemy import FromClause, Table, bindparam, func, select
from sqlalchemy.dialects import postgresql
from sqlalchemy.types import TypeEngine, UserDefinedType

_POSTGRESQL: Final = postgresql.dialect()  # type: ignore[no-untyped-call]


class Given(NamedTuple):
    """What a statement knows of its rows: some columns of a table, and whether there is one row."""

    table: Table
    columns: tuple[str, ...]
    is_one: bool

    @classmethod
    def of(cls, table: Table, rows: Sequence[Mapping[str, Any]]) -> Self:
        """Of these rows, one at least, which have the same columns. Any: whatever columns take."""
        return cls(table, tuple(rows[0]), len(rows) == 1)

    def rows(self, name: str) -> FromClause:
        """The rows, as the statement finds them in the parameters of this name."""
        parameters = [
            bindparam(f"{name}_{column}", type_=_Plain(self.table.c[column].type, self.is_one))
            for column in self.columns
        ]
        if self.is_one:
            labelled = zip(self.columns, parameters, strict=True)
            return select(*(value.label(column) for column, value in labelled)).subquery(name)
        return func.unnest(*parameters).table_valued(*self.columns, name=name).render_derived()

    def parameters(self, name: str, rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
        """The parameters for these rows. Any: whatever columns take."""
        if self.is_one:
            return {f"{name}_{column}": value for column, value in rows[0].items()}
        return {f"{name}_{column}": [row[column] for row in rows] for column in self.columns}


class _Plain(UserDefinedType[Any]):
    """Values of one type as the driver takes them: SQLAlchemy's own array looks at each of them."""

    cache_ok = True
    render_bind_cast = True

    def __init__(self, of: TypeEngine[Any], is_one: bool) -> None:
        self.of = of
        self.is_one = is_one

    def get_col_spec(self, **_: Any) -> str:
        """Any: what SQLAlchemy tells a type about its column."""
        name = self.of.compile(dialect=_POSTGRESQL)
        return name if self.is_one else f"{name}[]"
