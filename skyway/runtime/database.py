"""A service's own database, the same to use on SQLite and PostgreSQL.

`read` lends a connection that cannot write, `survey` one for questions that take long. `write`
lends a transaction, and leaving its block is the only commit there is. SQLite has one writer whose
commits are grouped (`sqlite_writer`); PostgreSQL has a connection per block, of those that can
write or of those that cannot. `write_alone` is for a write of one statement.
"""

import asyncio
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from typing import Any, Self

from asyncpg import PostgresError
from sqlalchemy import Executable, Table, text
from sqlalchemy.engine import Row
from sqlalchemy.exc import DBAPIError
from sqlalchemy.ext.asyncio import AsyncConnection, AsyncEngine

from skyway.runtime.engines import (
    Dialect,
    postgresql_engine,
    postgresql_reader_engine,
    read_url,
    sqlite_reader_engine,
    sqlite_survey_engine,
)
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.loops import Wake
from skyway.runtime.sqlite_writer import SqliteWriter
from skyway.runtime.transaction import Tx

__all__ = ["Database", "Tx"]

#: What a statement is told, by name; Any, since it may be of whatever type a column takes.
Values = Mapping[str, Any]


class Database:
    """One database, opened with `async with`; building one opens nothing.

    Parameters
    ----------
    url
        ``sqlite:///path`` or ``postgresql://user@host/name``.
    outbox
        The table of messages that leave with a transaction, when this service sends any.
    """

    def __init__(self, url: str, *, outbox: Table | None = None) -> None:
        self._url = read_url(url)
        self.dialect: Dialect = "sqlite" if self._url.drivername == "sqlite" else "postgresql"
        self.outbox = outbox
        self._wakes: dict[str, list[Wake]] = {}
        self._opened = AsyncExitStack()
        self._readers: AsyncEngine | None = None
        self._surveys: AsyncEngine | None = None
        self._writers: AsyncEngine | None = None
        self._lone_writers: AsyncEngine | None = None
        self._sqlite_writer: SqliteWriter | None = None

    async def __aenter__(self) -> Self:
        if self.dialect == "sqlite":
            # The writer opens first: it turns the file into one that many can read.
            self._sqlite_writer = await self._opened.enter_async_context(SqliteWriter(self._url))
            self._readers = sqlite_reader_engine(self._url)
            self._surveys = sqlite_survey_engine(self._url)
            self._opened.push_async_callback(self._surveys.dispose)
        else:
            self._readers = self._surveys = postgresql_reader_engine(self._url)
            self._writers = postgresql_engine(self._url)
            # The same connections.
            self._lone_writers = self._writers.execution_options(isolation_level="AUTOCOMMIT")
            self._opened.push_async_callback(self._writers.dispose)
        self._opened.push_async_callback(self._readers.dispose)
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._opened.aclose()
        self._readers = self._surveys = self._writers = self._lone_writers = None
        self._sqlite_writer = None

    @asynccontextmanager
    async def read(self) -> AsyncIterator[AsyncConnection]:
        """A connection to read from: on SQLite one moment's data, however long it is held.

        On PostgreSQL each statement sees the data of its own moment.
        """
        async with self._connect(self._readers) as connection:
            yield connection

    @asynccontextmanager
    async def survey(self) -> AsyncIterator[AsyncConnection]:
        """A connection to read much from, all of it one moment's data.

        On SQLite others go on while a statement runs.
        """
        async with self._connect(self._surveys) as connection:
            if self.dialect == "postgresql":
                await connection.execution_options(isolation_level="REPEATABLE READ")
            yield connection

    @asynccontextmanager
    async def write(self) -> AsyncIterator[Tx]:
        """A transaction: all of the block is on disk when it is left, or nothing of it.

        Raises
        ------
        ServiceUnavailable
            The database could not be reached or did not commit.
        """
        async with self._begin() as connection:
            tx = Tx(connection, dialect=self.dialect, outbox=self.outbox)
            yield tx
            channels = await tx.finish()
        for channel in channels:
            for wake in self._wakes.get(channel, ()):
                wake.set()
        tx.committed()

    async def write_alone(
        self, statement: Executable, parameters: Values | Sequence[Values]
    ) -> Sequence[Row[*tuple[Any, ...]]]:
        """Run one statement that is a transaction of its own; the rows that it returns.

        PostgreSQL then needs neither BEGIN nor COMMIT, two round trips of three.

        Raises
        ------
        ServiceUnavailable
            As of `write`; the statement may have been run.
        """
        if self._sqlite_writer:
            async with self.write() as tx:
                done = await tx.execute(statement, parameters)
        else:
            async with self._connect(self._lone_writers) as connection:
                done = await connection.execute(statement, parameters)
        return done.all() if done.returns_rows else ()

    def wake_when_sent(self, wake: Wake, *, channel: str) -> None:
        """Set `wake` after each commit that put messages for this channel into the outbox."""
        self._wakes.setdefault(channel, []).append(wake)

    async def is_answering(self) -> bool:
        """Whether the database can be read now."""
        try:
            async with self.read() as connection:
                await connection.execute(text("SELECT 1"))
        except ServiceUnavailable:
            return False
        return True

    @asynccontextmanager
    async def _connect(self, pool: AsyncEngine | None) -> AsyncIterator[AsyncConnection]:
        """A connection of the pool; a server that is gone is told in our own words."""
        if pool is None:
            raise ServiceUnavailable("database", "it is not open")
        connection = pool.connect()
        try:
            await connection.start()
        except (OSError, DBAPIError, PostgresError) as error:
            raise ServiceUnavailable("database", f"no connection: {error}") from error
        try:
            yield connection
        except DBAPIError as error:
            if not error.connection_invalidated:
                raise
            raise ServiceUnavailable("database", "the connection was lost") from error
        finally:
            # A cancelled block must still give its connection back.
            await asyncio.shield(connection.close())

    def _begin(self) -> AbstractAsyncContextManager[AsyncConnection]:
        return self._sqlite_writer.block() if self._sqlite_writer else self._begin_on_postgresql()

    @asynccontextmanager
    async def _begin_on_postgresql(self) -> AsyncIterator[AsyncConnection]:
        async with self._connect(self._writers) as connection, connection.begin():
            yield connection
