"""Where a service's data is stored: a SQLite file with one writer, or a PostgreSQL server."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from typing import Any, Protocol, Self, TypeVar

from sqlalchemy import Executable
from sqlalchemy.engine import URL, CursorResult
from sqlalchemy.exc import DBAPIError
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.sql.connection import BlockConnection, Values
from skyway.runtime.sql.server_url import PostgresqlServer
from skyway.runtime.sql.sqlite_engines import sqlite_reader_engine, sqlite_survey_engine
from skyway.runtime.sql.sqlite_writer import SqliteWriter
from skyway.runtime.sql.trouble import (
    NameTrouble,
    named_trouble,
    spoils_connection,
    trouble_of_reading,
    trouble_of_writing,
)


class Storage(Protocol):
    """The connections of an open database, each for as long as a block lasts."""

    def read(self) -> AbstractAsyncContextManager[AsyncConnection]:
        """A connection to read from."""
        ...

    def survey(self) -> AbstractAsyncContextManager[AsyncConnection]:
        """A connection for long reads that must all see the data of one moment."""
        ...

    def write(self) -> AbstractAsyncContextManager[BlockConnection]:
        """A connection in a transaction, which is committed when the block is left."""
        ...


class SqliteStorage:
    """A file with one writer."""

    def __init__(self, url: URL) -> None:
        self._writer = SqliteWriter(url)
        self._readers = sqlite_reader_engine(url)
        self._surveys = sqlite_survey_engine(url)
        self._opened = AsyncExitStack()

    async def __aenter__(self) -> Self:
        # The writer opens first: it switches the file to the write-ahead log that allows readers.
        await self._opened.enter_async_context(self._writer)
        self._opened.push_async_callback(self._surveys.dispose)
        self._opened.push_async_callback(self._readers.dispose)
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._opened.aclose()

    @asynccontextmanager
    async def read(self) -> AsyncIterator[AsyncConnection]:
        """A connection to read from. All reads of a block see the data of one moment."""
        async with connected(AsyncConnection(self._readers)) as connection:
            yield connection
        # Nothing above waits, and a loop that only reads must still let other tasks run.
        await asyncio.sleep(0)

    @property
    def commits(self) -> int:
        """The number of commits that changed rows."""
        return self._writer.commits

    def survey(self) -> AbstractAsyncContextManager[AsyncConnection]:
        """The same. The event loop goes on while a statement runs."""
        return connected(AsyncConnection(self._surveys))

    @asynccontextmanager
    async def write(self) -> AsyncIterator[BlockConnection]:
        """The writing connection, when it is this block's turn."""
        with named_trouble(trouble_of_writing):
            async with self._writer.block() as connection:
                yield BlockConnection(connection.engine, connection.sync_connection)


class PostgresqlStorage:
    """A server. Readers and writers have connection pools of their own."""

    def __init__(self, url: URL) -> None:
        from skyway.runtime.sql.postgresql_engines import (
            postgresql_engine,
            postgresql_reader_engine,
        )

        self._readers = postgresql_reader_engine(url)
        self._writers = postgresql_engine(url)
        has_pooler = PostgresqlServer.of(url).has_pooler
        self._block = _PostgresqlBlock if has_pooler else _DirectBlock
        self._is_open = False

    async def __aenter__(self) -> Self:
        self._is_open = True
        return self

    async def __aexit__(self, *_: object) -> None:
        self._is_open = False
        await self._writers.dispose()
        await self._readers.dispose()

    def read(self) -> AbstractAsyncContextManager[AsyncConnection]:
        """A connection to read from. Each statement sees the data of its own moment."""
        return connected(AsyncConnection(self._readers))

    @asynccontextmanager
    async def survey(self) -> AsyncIterator[AsyncConnection]:
        """A connection to read from. All statements see the data of one moment."""
        async with connected(AsyncConnection(self._readers)) as connection:
            await connection.execution_options(isolation_level="REPEATABLE READ")
            yield connection

    @asynccontextmanager
    async def write(self) -> AsyncIterator[BlockConnection]:
        """A connection in a transaction of its own, which begins with the first statement."""
        block = self._block(self._writers)
        async with connected(block, trouble_of_writing):
            yield block
            await block.commit_block()


class _PostgresqlBlock(BlockConnection):
    """The connection of a write block on PostgreSQL."""

    async def commit_block(self) -> None:
        """Commit everything that the block has written."""
        transaction = self.get_transaction()
        if transaction is not None:
            await transaction.commit()


class _DirectBlock(_PostgresqlBlock):
    """The connection of a write block without a pooler between it and the server."""

    async def execute_last(
        self, statement: Executable, parameters: Values | Sequence[Values]
    ) -> CursorResult[*tuple[Any, ...]]:
        """Run the last statement of the block.

        Without earlier statements it is a transaction by itself: BEGIN and COMMIT would be two
        round trips to the server for nothing.
        """
        if not self.in_transaction():
            await self.execution_options(isolation_level="AUTOCOMMIT")
        return await self.execute(statement, parameters)


ConnectionT = TypeVar("ConnectionT", bound=AsyncConnection)


@asynccontextmanager
async def connected(
    connection: ConnectionT, trouble_of: NameTrouble = trouble_of_reading
) -> AsyncIterator[ConnectionT]:
    """Take the connection from the pool of its engine. An error rolls its transaction back.

    Raises
    ------
    ServiceUnavailable
        There is no connection, or the block met trouble.
    """
    with named_trouble(trouble_of):
        try:
            await connection.start()
        except DBAPIError as error:
            no_connection = ServiceUnavailable("database", "no connection")
            raise trouble_of(error) or no_connection from error
        try:
            yield connection
        except BaseException as error:
            if spoils_connection(error):
                await connection.invalidate()
            # A cancelled block must still give its connection back.
            await asyncio.shield(connection.close())
            raise
        await connection.close()
