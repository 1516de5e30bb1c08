"""SQLite's driver without a hop to a thread for each statement.

aiosqlite passes every cursor, statement and row to a thread of the connection and waits for its
answer. That takes several times as long as our statements. Here statements run where they are
awaited. Only those that wait for the disk or for the lock of another process run in the thread.
"""

import sqlite3
from collections.abc import Callable
from typing import Any, Final

import aiosqlite

#: The statements that wait: for the writer's lock, and for the disk.
_WAITING: Final = (("BEGIN IMMEDIATE",), ("COMMIT",))


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
