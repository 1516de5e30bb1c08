"""SQLite's driver without a hop to a thread for each statement.

aiosqlite hands every cursor, statement and row to a thread of the connection's own and waits for
its answer; that takes several times as long as a statement of ours does. Here they run where they
are awaited, and only what waits for the disk or for another process's lock goes to the thread.
"""

import sqlite3
from collections.abc import Callable
from typing import Any, Final

import aiosqlite

#: Statements that wait: for the lock that one writer holds, and for the disk.
_WAITING: Final = (("BEGIN IMMEDIATE",), ("COMMIT",))


class PromptConnection(aiosqlite.Connection):
    """A connection whose statements are over when they are awaited.

    Readers of a write-ahead log wait for nobody, and there is one writer: so none of them blocks
    the event loop for longer than it works.
    """

    async def _execute(self, fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        """Call the driver's function; what it takes and returns may be anything."""
        if self._connection is None or fn == self._connection.close or args[:1] in _WAITING:
            # aiosqlite has no types there.
            return await super()._execute(fn, *args, **kwargs)  # type: ignore[no-untyped-call]
        if not self._running:
            raise ValueError("Connection closed")  # the words that SQLAlchemy knows
        return fn(*args, **kwargs)


def connect(database: str, **options: Any) -> PromptConnection:
    """A connection to be awaited; the options are those of `sqlite3.connect`."""
    options["check_same_thread"] = False
    connection = PromptConnection(lambda: sqlite3.connect(database, **options), iter_chunk_size=64)
    # SQLAlchemy does so for the connections that it makes: a forgotten one must not keep us alive.
    connection._thread.daemon = True
    return connection
