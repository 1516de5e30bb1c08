"""How Skyway opens SQLite and PostgreSQL: drivers, durability, who begins a transaction."""

import asyncio
from collections.abc import Mapping
from typing import Any, Final, Literal

import aiosqlite
from sqlalchemy import event, make_url
from sqlalchemy.engine import URL, Connection, ExceptionContext
from sqlalchemy.engine.interfaces import DBAPIConnection, IsolationLevel
from sqlalchemy.exc import ArgumentError
from sqlalchemy.ext.asyncio import AsyncEngine, create_async_engine
from sqlalchemy.pool import AsyncAdaptedQueuePool, NullPool

from skyway.errors import InvalidInput
from skyway.runtime.errors import UnsafeDatabase
from skyway.runtime.sql.sqlite_driver import connect

Dialect = Literal["sqlite", "postgresql"]

#: How long a statement waits for another process that holds SQLite's lock, seconds.
_BUSY_TIMEOUT_S: Final = 10

#: Statements that a connection to PostgreSQL keeps prepared: more than a service has.
_STATEMENTS: Final = 500

#: What a connection to SQLite must say of itself: 2 is FULL, every commit is synced.
_SAFE: Final = {"journal_mode": "wal", "synchronous": 2, "foreign_keys": 1}


def read_url(text: str) -> URL:
    """The URL of a database, without a driver.

    Raises
    ------
    InvalidInput
        It is neither ``sqlite:///path`` nor ``postgresql://...``; the message holds no password.
    """
    try:
        url = make_url(text)
    except (ArgumentError, ValueError) as error:
        raise InvalidInput("database_url", "not a URL") from error
    dialect = url.get_backend_name()
    if dialect not in ("sqlite", "postgresql") or (dialect == "sqlite" and not url.database):
        raise InvalidInput(
            "database_url", f"{dialect}: only sqlite:///path and postgresql://... are known"
        )
    return url.set(drivername=dialect)


def sqlite_engine(url: URL, **driver: Any) -> AsyncEngine:
    """An engine that leaves BEGIN and COMMIT to its caller, and never commits by itself.

    Any: what else the driver is told; each option has a type of its own.
    """
    engine = create_async_engine(
        url.set(drivername="sqlite+aiosqlite"),
        hide_parameters=True,  # in the text of errors: there are addresses among them
        # Without an isolation level the driver begins nothing by itself.
        connect_args={
            "timeout": _BUSY_TIMEOUT_S,
            "isolation_level": None,
            "async_creator_fn": connect,
            **driver,
        },
        poolclass=AsyncAdaptedQueuePool,
        pool_size=4,
        max_overflow=12,
    )
    event.listen(engine.sync_engine, "connect", _make_durable)
    event.listen(engine.sync_engine, "handle_error", _outlive_cancellation)
    return engine


def sqlite_reader_engine(url: URL, **driver: Any) -> AsyncEngine:
    """An engine that cannot write, and whose transactions see one moment's data.

    Any: what else the driver is told; each option has a type of its own.
    """
    engine = sqlite_engine(url, **driver)
    event.listen(engine.sync_engine, "connect", _make_read_only)
    event.listen(engine.sync_engine, "begin", _begin_deferred)
    return engine


def sqlite_survey_engine(url: URL) -> AsyncEngine:
    """A reading engine whose statements run in a thread, however long they take."""
    return sqlite_reader_engine(url, async_creator_fn=aiosqlite.connect)


def postgresql_engine(url: URL) -> AsyncEngine:
    """An engine whose transactions SQLAlchemy begins and ends."""
    return _postgresql_engine(url, isolation_level="READ COMMITTED", settings={})


def postgresql_writer_engine(url: URL) -> AsyncEngine:
    """An engine that never begins a transaction by itself."""
    return _postgresql_engine(url, isolation_level="AUTOCOMMIT", settings={})


def postgresql_reader_engine(url: URL) -> AsyncEngine:
    """An engine that cannot write, and on which each statement is on its own.

    READ COMMITTED has each statement see a moment of its own anyway, so BEGIN and ROLLBACK around
    them would be two round trips for nothing.
    """
    settings = {"default_transaction_read_only": "on"}
    return _postgresql_engine(url, isolation_level="AUTOCOMMIT", settings=settings)


def _postgresql_engine(
    url: URL, *, isolation_level: IsolationLevel, settings: Mapping[str, str]
) -> AsyncEngine:
    """An engine that keeps no connections: who has one keeps it (`lending`)."""
    return create_async_engine(
        url.set(drivername="postgresql+asyncpg"),
        isolation_level=isolation_level,
        hide_parameters=True,  # in the text of errors: there are addresses among them
        skip_autocommit_rollback=True,
        poolclass=NullPool,
        connect_args={
            "timeout": 10,
            "command_timeout": 60,
            "prepared_statement_cache_size": _STATEMENTS,
            "server_settings": {
                "jit": "off",
                # What services ask for lies in memory: a row by its index costs like any other, and
                # whole tables are not read to spare a few disk seeks that there are none of.
                "random_page_cost": "1.1",
                "default_transaction_isolation": "read committed",
                **settings,
            },
        },
    )


def _begin_deferred(connection: Connection) -> None:
    # Past SQLAlchemy's execution, which takes ten times as long as this does.
    connection.connection.cursor().execute("BEGIN DEFERRED")


def _make_read_only(connection: DBAPIConnection, _record: Any) -> None:
    """Any: the pool's record of the connection, which is not looked at."""
    cursor = connection.cursor()
    cursor.execute("PRAGMA query_only = ON")
    cursor.close()


def _make_durable(connection: DBAPIConnection, _record: Any) -> None:
    """Any: the pool's record of the connection, which is not looked at."""
    cursor = connection.cursor()
    try:
        for setting in ("journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON"):
            cursor.execute(f"PRAGMA {setting}")
        for name, wanted in _SAFE.items():
            cursor.execute(f"PRAGMA {name}")
            row = cursor.fetchone()
            if row is None or row[0] != wanted:
                raise UnsafeDatabase(f"SQLite has {name} {row and row[0]}, {wanted} is needed")
    finally:
        cursor.close()


def _outlive_cancellation(context: ExceptionContext) -> None:
    """Keep a SQLite connection whose statement was cancelled.

    The driver's thread finishes the statement before the next one, the rollback, so that nothing
    is left half done; dropping the connection would drop what others wrote in the same group.
    """
    if isinstance(context.original_exception, asyncio.CancelledError):
        context.is_disconnect = False
