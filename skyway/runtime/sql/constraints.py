"""Which rule of the database refused a row, under the same name on SQLite and PostgreSQL."""

import re
from typing import Final

from sqlalchemy.exc import DBAPIError
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.runtime.sql.engines import Dialect

#: unique_violation, exclusion_violation and raise_exception (a trigger's own rule).
_POSTGRESQL_REFUSALS: Final = ("23505", "23P01", "P0001")

_SQLITE_UNIQUE: Final = (
    "SQLITE_CONSTRAINT_UNIQUE",
    "SQLITE_CONSTRAINT_PRIMARYKEY",
    "SQLITE_CONSTRAINT_ROWID",
)
_NAMED_UNIQUE: Final = re.compile(
    r"CONSTRAINT\s+\"?(?P<name>\w+)\"?\s+UNIQUE\s*\((?P<columns>[^)]*)\)", re.IGNORECASE
)


async def violated_constraint(
    connection: AsyncConnection, error: DBAPIError, *, dialect: Dialect
) -> str | None:
    """Name of the unique, exclusion or trigger rule behind an error; None for any other error.

    A trigger's rule is called what it raises: ``RAISE(ABORT, 'pad_taken')`` on SQLite,
    ``RAISE EXCEPTION 'pad_taken'`` on PostgreSQL.
    """
    if dialect == "postgresql":
        return _on_postgresql(error)
    name = getattr(error.orig, "sqlite_errorname", None)
    if name == "SQLITE_CONSTRAINT_TRIGGER":
        return str(error.orig)
    if name in _SQLITE_UNIQUE:
        return await _on_sqlite(connection, str(error.orig).partition(": ")[2])
    return None


def _on_postgresql(error: DBAPIError) -> str | None:
    refused = error.driver_exception
    if getattr(refused, "sqlstate", None) not in _POSTGRESQL_REFUSALS:
        return None
    return getattr(refused, "constraint_name", None) or str(refused)


async def _on_sqlite(connection: AsyncConnection, place: str) -> str:
    """The name of an index or constraint; SQLite reports only ``table.column, ...``."""
    if place.startswith("index "):
        return place.removeprefix("index ").strip("'")
    table = place.partition(".")[0]
    columns = [part.rpartition(".")[2] for part in place.split(", ")]
    indexes = await connection.exec_driver_sql(
        'SELECT name, origin FROM pragma_index_list(?) WHERE "unique"', (table,)
    )
    for row in indexes.mappings():
        parts = await connection.exec_driver_sql(
            "SELECT name FROM pragma_index_info(?) ORDER BY seqno", (row["name"],)
        )
        if row["origin"] == "c" and list(parts.scalars()) == columns:
            return str(row["name"])
    return await _named_in_table(connection, table, columns)


async def _named_in_table(connection: AsyncConnection, table: str, columns: list[str]) -> str:
    """The constraint's name in CREATE TABLE, or else the name that PostgreSQL would give it."""
    found = await connection.exec_driver_sql(
        "SELECT sql FROM sqlite_master WHERE type = 'table' AND name = ?", (table,)
    )
    for match in _NAMED_UNIQUE.finditer(found.scalar() or ""):
        if [part.strip(' "') for part in match["columns"].split(",")] == columns:
            return match["name"]
    key = await connection.exec_driver_sql(
        "SELECT name FROM pragma_table_info(?) WHERE pk > 0 ORDER BY pk", (table,)
    )
    if list(key.scalars()) == columns:
        return f"{table}_pkey"
    return f"{table}_{'_'.join(columns)}_key"
