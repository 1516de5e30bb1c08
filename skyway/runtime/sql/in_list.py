"""Whether a column's value is in a list, in SQL that is the same for lists of every length.

SQLAlchemy's own ``in_`` writes a parameter for each value. So each length of the list is another
text, which is written for each execution and prepared again by each connection.
"""

from typing import Any, Self

from sqlalchemy import JSON, ColumnElement, bindparam
from sqlalchemy.dialects.postgresql import ARRAY
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.sql.functions import FunctionElement
from sqlalchemy.sql.operators import OperatorType
from sqlalchemy.types import Boolean


def in_list(column: ColumnElement[Any], name: str) -> ColumnElement[bool]:
    """Whether a column's value is in the list of values given as parameter `name`.

    Any: a column may hold any type that both databases can compare.
    """
    values = ARRAY(column.type).with_variant(JSON(), "sqlite")
    return _InList(column, bindparam(name, type_=values))


class _InList(FunctionElement[bool]):
    """A value and the parameter that holds the list."""

    inherit_cache = True
    type = Boolean()

    def self_group(self, against: OperatorType | None = None) -> Self:
        """Unchanged. SQLAlchemy would compare it with 1 on SQLite, which then ignores the index."""
        return self


@compiles(_InList, "postgresql")
def _on_postgresql(element: _InList, compiler: SQLCompiler, **options: Any) -> str:
    """Any: options of SQLAlchemy's compiler."""
    value, values = (compiler.process(each, **options) for each in element.clauses)
    return f"{value} = ANY ({values})"


@compiles(_InList, "sqlite")
def _on_sqlite(element: _InList, compiler: SQLCompiler, **options: Any) -> str:
    """Any: options of SQLAlchemy's compiler."""
    value, values = (compiler.process(each, **options) for each in element.clauses)
    # These are compiled parts, such as a column and a question mark, and no input.
    return f"{value} IN (SELECT value FROM json_each({values}))"  # noqa: S608
