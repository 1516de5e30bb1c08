"""The size of a stored text, found without reading a long text on PostgreSQL.

PostgreSQL keeps long texts outside of their row, compressed, together with their size.
"""

from typing import Any

from sqlalchemy import ColumnElement
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.sql.functions import FunctionElement
from sqlalchemy.types import Integer


def text_size(column: ColumnElement[Any]) -> ColumnElement[int]:
    """How long the text in this column is: in bytes on PostgreSQL, in characters on SQLite."""
    return _TextSize(column)


class _TextSize(FunctionElement[int]):
    """The column whose text is measured."""

    inherit_cache = True
    type = Integer()


@compiles(_TextSize, "postgresql")
def _on_postgresql(element: _TextSize, compiler: SQLCompiler, **options: Any) -> str:
    """Any: options of SQLAlchemy's compiler."""
    return f"octet_length({compiler.process(element.clauses, **options)})"


@compiles(_TextSize, "sqlite")
def _on_sqlite(element: _TextSize, compiler: SQLCompiler, **options: Any) -> str:
    """Any: options of SQLAlchemy's compiler."""
    # SQLite knows octet_length only from 3.43 on.
    return f"length({compiler.process(element.clauses, **options)})"
