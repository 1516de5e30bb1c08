"""How Skyway opens SQLite: driver, durability, transactions.

aiosqlite passes every cursor, statement and row to a thread of the connection and waits for its
answer. That takes several times as long as our statements. Here statements run where they are
awaited. Only those that wait for the disk or for the lock of another process run in the thread.
"""

import asyncio
import sqlite3
from collections.abc import Callable
from typing import Any, Final
from urllib.parse import quote

import aiosqlite
from sqlalchemy import event
from sqlalchemy.engine import URL, Connection, ExceptionContext
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.ext.asyncio import AsyncEngine, create_async_engine
from sqlalchemy.pool import AsyncAdaptedQueuePool

from skyway.runtime.errors import UnsafeDatabase

#: The statements that wait: for the writer's lock, and for the disk.
_WAITING: Final = (("BEGIN IMMEDIATE",), ("COMMIT",))

#: How long a statement waits for another process that holds SQLite's lock, seconds.
_BUSY_TIMEOUT_S: Final = 10

#: The settings that a SQLite connection must have; synchronous 2 is FULL: every commit is synced.
_SAFE: Final = {"journal_mode": "wal", "synchronous": 2, "foreign_keys": 1}


class PromptConnection(aiosqlite.Connection):
    """A connection whose statements run in the thread of the event loop.

    Readers of a write-ahead log never wait, and there is one writer. So no statement blocks the
    event loop for longer than it works.
    """

    async def _connect(self) -> aiosqlite.Connection:
        try:
            return await super()._connect()
        except sqlite3.Error:
            # The thread has nothing left to do. It must not end later than the event loop.
            self._thread.join()
            raise

    async def _execute(self, fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        """Call the driver's function; what it takes and returns may be anything."""
        if self._connection is None or fn == self._connection.close or args[:1] in _WAITING:
            # aiosqlite has no types there.
            return await super()._execute(fn, *args, **kwargs)  # type: ignore[no-untyped-call]
        if not self._running:
            raise ValueError("Connection closed")  # the words that SQLAlchemy knows
        return fn(*args, **kwargs)


def connect(database: str, **options: Any) -> PromptConnection:
    """A connection that opens when it is awaited; the options are those of `sqlite3.connect`."""
    options["check_same_thread"] = False
    connection = PromptConnection(lambda: sqlite3.connect(database, **options), iter_chunk_size=64)
    # A forgotten connection must not keep the process alive. SQLAlchemy sets this for its own.
    connection._thread.daemon = True
    return connection


def sqlite_engine(url: URL, **driver: Any) -> AsyncEngine:
    """An engine that leaves BEGIN and COMMIT to its caller, and never commits by itself.

    Any: more options of the driver; each has a type of its own.
    """
    engine = _sqlite_engine(url, **driver)
    event.listen(engine.sync_engine, "connect", _make_durable)
    return engine


def _sqlite_engine(url: URL, **driver: Any) -> AsyncEngine:
    """Any: more options of the driver; each has a type of its own."""
    engine = create_async_engine(
        url.set(drivername="sqlite+aiosqlite"),
        hide_parameters=True,  # in the text of errors: some parameters are addresses
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
    event.listen(engine.sync_engine, "handle_error", _outlive_cancellation)
    return engine


def sqlite_reader_engine(url: URL, **driver: Any) -> AsyncEngine:
    """An engine that cannot write, and whose transactions see one moment's data.

    Any: more options of the driver; each has a type of its own.
    """
    return _made_reader(sqlite_engine(url, **driver))


def sqlite_file_reader_engine(url: URL) -> AsyncEngine:
    """The same for the file of another process: this one neither makes the file nor changes it."""
    engine = _sqlite_engine(url, async_creator_fn=_connect_read_only)
    event.listen(engine.sync_engine, "connect", _read_schema)
    return _made_reader(engine)


def _connect_read_only(database: str, **options: Any) -> PromptConnection:
    return connect(f"file:{quote(database)}?mode=ro", uri=True, **options)


def _made_reader(engine: AsyncEngine) -> AsyncEngine:
    event.listen(engine.sync_engine, "connect", _make_read_only)
    event.listen(engine.sync_engine, "begin", _begin_deferred)
    return engine


def sqlite_survey_engine(url: URL) -> AsyncEngine:
    """A reading engine whose statements run in a thread, however long they take."""
    return sqlite_reader_engine(url, async_creator_fn=aiosqlite.connect)


def _begin_deferred(connection: Connection) -> None:
    # The driver's cursor takes a tenth of the time of SQLAlchemy's execution.
    connection.connection.cursor().execute("BEGIN DEFERRED")


def _make_read_only(connection: DBAPIConnection, _record: Any) -> None:
    """Any: the pool's record of the connection, which is not used."""
    cursor = connection.cursor()
    cursor.execute("PRAGMA query_only = ON")
    cursor.close()


def _read_schema(connection: DBAPIConnection, _record: Any) -> None:
    """Find out whether the file is a database. Any: the pool's record, which is not used."""
    cursor = connection.cursor()
    cursor.execute("SELECT count(*) FROM sqlite_master")
    cursor.close()


def _make_durable(connection: DBAPIConnection, _record: Any) -> None:
    """Any: the pool's record of the connection, which is not used."""
    try:
        _apply_settings(connection)
    except BaseException:
        # The pool does not know this connection yet. Left open, it would keep its thread and file.
        connection.close()
        raise


def _apply_settings(connection: DBAPIConnection) -> None:
    cursor = connection.cursor()
    try:
        for setting in ("journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON"):
            cursor.execute(f"PRAGMA {setting}")
        for name, required in _SAFE.items():
            cursor.execute(f"PRAGMA {name}")
            row = cursor.fetchone()
            if row is None or row[0] != required:
                raise UnsafeDatabase(f"SQLite has {name} {row and row[0]}, {required} is needed")
    finally:
        cursor.close()


def _outlive_cancellation(context: ExceptionContext) -> None:
    """Keep a SQLite connection whose statement was cancelled.

    The driver's thread finishes the statement before it runs the rollback, so nothing is left half
    done. Closing the connection would lose what other blocks wrote in the same group.
    """
    if isinstance(context.original_exception, asyncio.CancelledError):
        context.is_disconnect = False
