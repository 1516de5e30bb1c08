"""A statement that one connection to PostgreSQL keeps prepared."""

from collections.abc import Sequence
from typing import Any

from asyncpg import Record
from asyncpg.prepared_stmt import PreparedStatement
from sqlalchemy import Dialect
from sqlalchemy.engine import result_tuple

from skyway.runtime.sql.found import FoundRows
from skyway.runtime.sql.written import Written


class Prepared:
    """The statement, and how its rows are read."""

    def __init__(
        self, statement: "PreparedStatement[Record]", written: Written, *, dialect: Dialect
    ) -> None:
        self.statement = statement
        attributes = statement.get_attributes()
        columns = written.columns
        self._to_row = result_tuple(
            [each.name for each in attributes], [(column,) for column in columns]
        )
        self._convert = [
            column.type.dialect_impl(dialect).result_processor(dialect, attribute.type.oid)
            for column, attribute in zip(columns, attributes, strict=True)
        ]
        self._is_converted = any(self._convert)

    def found(self, records: Sequence[Record]) -> FoundRows:
        """The rows that the driver has read."""
        read = map(self._converted, records) if self._is_converted else records
        return FoundRows(
            [self._to_row(each) for each in read],
            status=self.statement.get_statusmsg(),
            returns_rows=bool(self._convert),
        )

    def _converted(self, record: Record) -> list[Any]:
        """Any: columns are of every type."""
        return [
            value if convert is None else convert(value)
            for value, convert in zip(record, self._convert, strict=True)
        ]
