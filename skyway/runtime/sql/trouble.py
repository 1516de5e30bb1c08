"""What the errors of a database mean: trouble of the database itself, or a rule that refused a row.

Trouble is of its server, its disk, or the way to them. The same request may succeed later, so
trouble is `ServiceUnavailable`. A rule has the same name on SQLite and PostgreSQL. Every other
error of a statement is a bug of ours.
"""

import os
import re
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as NoFreeConnection
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.runtime.errors import DamagedDatabase, ServiceUnavailable
from skyway.runtime.metrics import count
from skyway.runtime.sql.server_url import Dialect

#: Classes of SQLSTATE, each with what it means, and single states of other classes.
#: https://www.postgresql.org/docs/current/errcodes-appendix.html
_POSTGRESQL: Final = {
    "08": "the connection failed",
    "28": "the server refuses the role or its password",
    "3D": "the server has no such database",
    "40": "the transaction was rolled back in favour of another",
    "53": "the server lacks memory, disk or connections",
    "55P03": "a lock was not available in time",
    "57": "the server stops, starts, or cancelled the statement",
    "58": "the server's system failed",
    "F0": "the server's configuration is broken",
    "XX": "the server failed inside",
    "25P03": "the server ended an idle transaction",
    "25P04": "the server ended a long transaction",
    "42501": "the role has lost a right",
}
_POSTGRESQL_READ_ONLY: Final = "25006"
_POSTGRESQL_DAMAGED: Final = ("XX001", "XX002")

#: Primary result codes. https://www.sqlite.org/rescode.html
_SQLITE: Final = frozenset(
    {
        sqlite3.SQLITE_PERM,
        sqlite3.SQLITE_BUSY,
        sqlite3.SQLITE_LOCKED,
        sqlite3.SQLITE_NOMEM,
        sqlite3.SQLITE_IOERR,
        sqlite3.SQLITE_CORRUPT,
        sqlite3.SQLITE_FULL,
        sqlite3.SQLITE_CANTOPEN,
        sqlite3.SQLITE_PROTOCOL,
        sqlite3.SQLITE_NOLFS,
        sqlite3.SQLITE_NOTADB,
    }
)
_SQLITE_DAMAGED: Final = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)

#: The trouble behind an error; None when the error is a bug.
NameTrouble = Callable[[BaseException], ServiceUnavailable | None]

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


@contextmanager
def named_trouble(name: NameTrouble) -> Iterator[None]:
    """Let a block use the database.

    Raises
    ------
    ServiceUnavailable
        The block met trouble.
    """
    try:
        yield
    except ServiceUnavailable:
        count_trouble(1)
        raise
    except (DBAPIError, NoFreeConnection, sqlite3.Error, OSError, MemoryError) as error:
        trouble = name(error)
        if trouble is None:
            raise
        count_trouble(1)
        raise trouble from error


def trouble_of_reading(error: BaseException) -> ServiceUnavailable | None:
    """The trouble behind an error of a block that only reads."""
    if isinstance(error, NoFreeConnection):
        return _unavailable("all connections are in use")
    if isinstance(error, MemoryError):
        return _unavailable("out of memory")
    if isinstance(error, OSError):
        # Not the error's own text: it would show addresses and files to the caller.
        return _unavailable(os.strerror(error.errno) if error.errno else "no answer in time")
    if isinstance(error, DBAPIError):
        return _trouble_of_statement(error)
    return _sqlite_trouble(error)


def trouble_of_writing(error: BaseException) -> ServiceUnavailable | None:
    """The trouble behind an error of a block that writes.

    A block that only reads may not write. So "read-only" is trouble here, and a bug there.
    """
    if _is_read_only(_cause(error)):
        return _unavailable("it is read-only now")
    return trouble_of_reading(error)


def spoils_connection(error: BaseException) -> bool:
    """Whether the blocks after this error need a new connection.

    A connection that SQLite opened while the file could not be written stays read-only, and so does
    a connection to a server that has given its role to another.
    """
    cause = _cause(error)
    return _is_read_only(cause) or _sqlite_trouble(cause) is not None


def _cause(error: BaseException) -> BaseException | None:
    return error.orig if isinstance(error, DBAPIError) else error


def _is_read_only(cause: BaseException | None) -> bool:
    is_on_sqlite = getattr(cause, "sqlite_errorcode", None) == sqlite3.SQLITE_READONLY
    return is_on_sqlite or _sqlstate(cause) == _POSTGRESQL_READ_ONLY


def _trouble_of_statement(error: DBAPIError) -> ServiceUnavailable | None:
    state = _sqlstate(error.orig)
    if state.startswith(_POSTGRESQL_DAMAGED):
        return DamagedDatabase(str(error.orig))
    meaning = next((_POSTGRESQL[each] for each in _POSTGRESQL if state.startswith(each)), None)
    if meaning is not None:
        return _unavailable(f"{meaning} ({state})")
    trouble = _sqlite_trouble(error.orig)
    if trouble is None and error.connection_invalidated:
        return _unavailable("the connection was lost")
    return trouble


def _sqlite_trouble(cause: BaseException | None) -> ServiceUnavailable | None:
    code = getattr(cause, "sqlite_errorcode", None)
    if code is None:
        return None
    primary = code & 0xFF  # the other bits only describe it further
    if primary in _SQLITE_DAMAGED:
        return DamagedDatabase(str(cause))
    # The plain code means that a reading block tried to write. The other codes are about the files.
    if primary in _SQLITE or (primary == sqlite3.SQLITE_READONLY and code != primary):
        return _unavailable(f"{cause}")
    return None


def count_trouble(blocks: int) -> None:
    """Count blocks that met trouble of the database."""
    count("skyway_database_trouble", "blocks that met trouble of the database", blocks)


def _sqlstate(cause: BaseException | None) -> str:
    return getattr(cause, "sqlstate", None) or ""


def _unavailable(detail: str) -> ServiceUnavailable:
    return ServiceUnavailable("database", detail)


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
