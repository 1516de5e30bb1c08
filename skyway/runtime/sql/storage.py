"""Where a service's data lies: one writing and many reading connections of a file, or a server."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from typing import Protocol, Self

from sqlalchemy.engine import URL
from sqlalchemy.exc import DBAPIError
from sqlalchemy.ext.asyncio import AsyncConnection, AsyncEngine

from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.sql.block_connection import BlockConnection
from skyway.runtime.sql.engines import (
    postgresql_reader_engine,
    postgresql_writer_engine,
    sqlite_reader_engine,
    sqlite_survey_engine,
)
from skyway.runtime.sql.lending import Lending
from skyway.runtime.sql.lost_connection import loss_told
from skyway.runtime.sql.sqlite_writer import SqliteWriter
from skyway.runtime.sql.written import WrittenStatements


class Storage(Protocol):
    """The connections of an open database, each for as long as a block lasts."""

    def read(self) -> AbstractAsyncContextManager[AsyncConnection]:
        """A connection to read from."""
        ...

    def survey(self) -> AbstractAsyncContextManager[AsyncConnection]:
        """A connection to read much from, all of it one moment's data."""
        ...

    def write(self) -> AbstractAsyncContextManager[BlockConnection]:
        """A connection in a transaction, which is committed when the block is left."""
        ...

    def write_alone(self) -> AbstractAsyncContextManager[BlockConnection]:
        """A connection for one statement, which is a transaction of its own."""
        ...


class SqliteStorage:
    """A file with one writer."""

    def __init__(self, url: URL) -> None:
        self._writer = SqliteWriter(url)
        self._readers = sqlite_reader_engine(url)
        self._surveys = sqlite_survey_engine(url)
        self._opened = AsyncExitStack()

    async def __aenter__(self) -> Self:
        # The writer opens first: it turns the file into one that many can read.
        await self._opened.enter_async_context(self._writer)
        self._opened.push_async_callback(self._surveys.dispose)
        self._opened.push_async_callback(self._readers.dispose)
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._opened.aclose()

    def read(self) -> AbstractAsyncContextManager[AsyncConnection]:
        """A connection to read from: one moment's data, however long it is held."""
        return _connect(self._readers)

    def survey(self) -> AbstractAsyncContextManager[AsyncConnection]:
        """The same; others go on while a statement runs."""
        return _connect(self._surveys)

    @asynccontextmanager
    async def write(self) -> AsyncIterator[BlockConnection]:
        """The writing connection, in a turn of one's own."""
        async with self._writer.block() as connection:
            yield BlockConnection(connection.engine, connection.sync_connection)

    write_alone = write


class PostgresqlStorage:
    """A server."""

    def __init__(self, url: URL) -> None:
        statements = WrittenStatements()
        self._readers = Lending(postgresql_reader_engine(url), statements)
        self._writers = Lending(postgresql_writer_engine(url), statements)
        self._opened = AsyncExitStack()

    async def __aenter__(self) -> Self:
        await self._opened.enter_async_context(self._readers)
        await self._opened.enter_async_context(self._writers)
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._opened.aclose()

    def read(self) -> AbstractAsyncContextManager[AsyncConnection]:
        """A connection to read from: each statement sees the data of its own moment."""
        return self._readers.lend()

    @asynccontextmanager
    async def survey(self) -> AsyncIterator[AsyncConnection]:
        """A connection to read from, all of it one moment's data."""
        async with self._readers.lend() as connection, connection.one_moment():
            yield connection

    @asynccontextmanager
    async def write(self) -> AsyncIterator[BlockConnection]:
        """A connection in a transaction of its own."""
        async with self._writers.lend() as connection, connection.transaction():
            yield connection

    def write_alone(self) -> AbstractAsyncContextManager[BlockConnection]:
        """A connection whose statements need neither BEGIN nor COMMIT."""
        return self._writers.lend()


@asynccontextmanager
async def _connect(engine: AsyncEngine) -> AsyncIterator[AsyncConnection]:
    """A connection of the engine's pool; a file that is gone is told in our own words."""
    connection = engine.connect()
    try:
        await connection.start()
    except (OSError, DBAPIError) as error:
        raise ServiceUnavailable("database", f"no connection: {error}") from error
    try:
        with loss_told():
            yield connection
    finally:
        # A cancelled block must still give its connection back.
        await asyncio.shield(connection.close())
