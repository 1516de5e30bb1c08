"""The database of another process, opened to be read only."""

from contextlib import AbstractAsyncContextManager, AsyncExitStack
from typing import Protocol, Self

from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.runtime.sql.server_url import Dialect, read_url
from skyway.runtime.sql.sqlite_engines import sqlite_file_reader_engine
from skyway.runtime.sql.storage import PostgresqlStorage, connected


class Surveyed(Protocol):
    """A database of which one moment can be read."""

    @property
    def dialect(self) -> Dialect:
        """The kind of database."""
        ...

    def survey(self) -> AbstractAsyncContextManager[AsyncConnection]:
        """A connection for reads, which all see the data of one moment."""
        ...


class ReadOnlyDatabase:
    """A database that this process never changes, opened with `async with`.

    `url` is that of `Database`. A SQLite file must exist; statements run where they are awaited.
    """

    def __init__(self, url: str) -> None:
        self._url = read_url(url)
        self.dialect: Dialect = "sqlite" if self._url.drivername == "sqlite" else "postgresql"
        self._opened = AsyncExitStack()

    async def __aenter__(self) -> Self:
        if self.dialect == "sqlite":
            self._engine = sqlite_file_reader_engine(self._url)
            self._opened.push_async_callback(self._engine.dispose)
        else:
            self._server = await self._opened.enter_async_context(PostgresqlStorage(self._url))
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._opened.aclose()

    def survey(self) -> AbstractAsyncContextManager[AsyncConnection]:
        """A connection for reads, which all see the data of one moment.

        Raises
        ------
        ServiceUnavailable
            The database cannot be opened or read.
        """
        if self.dialect == "sqlite":
            return connected(AsyncConnection(self._engine))
        return self._server.survey()
