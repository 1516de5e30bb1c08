"""Connections to PostgreSQL that stay open and are lent to one block after another.

One that is closed after use costs a process of the server, a sign-in and all its prepared
statements each time.
"""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import Final, Self

from asyncpg import PostgresError
from sqlalchemy.exc import DBAPIError
from sqlalchemy.ext.asyncio import AsyncEngine

from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.sql.direct_connection import DirectConnection
from skyway.runtime.sql.lost_connection import loss_told
from skyway.runtime.sql.written import WrittenStatements

#: Connections that one process keeps to write, and as many to read.
_CONNECTIONS: Final = 8

#: How long a block waits for one of them, seconds.
_PATIENCE_S: Final = 30.0


class Lending:
    """Connections made by an engine; `async with` ends with closing them."""

    def __init__(self, engine: AsyncEngine, statements: WrittenStatements) -> None:
        self._engine = engine
        self._statements = statements
        self._is_open = False
        # None is a place for a connection that is yet to be made. The one used last goes first: it
        # has its statements prepared, and what they read at hand.
        self._places: asyncio.LifoQueue[DirectConnection | None] = asyncio.LifoQueue()
        for _ in range(_CONNECTIONS):
            self._places.put_nowait(None)

    async def __aenter__(self) -> Self:
        self._is_open = True
        return self

    async def __aexit__(self, *_: object) -> None:
        self._is_open = False
        while not self._places.empty():
            connection = self._places.get_nowait()
            if connection is not None:
                await connection.close()
        await self._engine.dispose()

    @contextlib.asynccontextmanager
    async def lend(self) -> AsyncIterator[DirectConnection]:
        """A connection of one's own; a server that is gone is told in our own words.

        Raises
        ------
        ServiceUnavailable
            There is no connection, or it was lost.
        """
        connection = await self._take()
        try:
            with loss_told():
                yield connection
        finally:
            await self._give_back(connection)

    async def _take(self) -> DirectConnection:
        if not self._is_open:
            raise ServiceUnavailable("database", "it is not open")
        connection = await self._next_place()
        # The driver hears at once when the server closes; nobody need ask the server.
        if connection is not None and not connection.is_spent:
            return connection
        try:
            if connection is not None:
                await connection.close()
            return await DirectConnection.open(self._engine, self._statements)
        except BaseException as error:
            self._places.put_nowait(None)
            if isinstance(error, OSError | DBAPIError | PostgresError):
                raise ServiceUnavailable("database", f"no connection: {error}") from error
            raise

    async def _next_place(self) -> DirectConnection | None:
        if not self._places.empty():
            return self._places.get_nowait()
        try:
            async with asyncio.timeout(_PATIENCE_S):
                return await self._places.get()
        except TimeoutError as error:
            raise ServiceUnavailable("database", "all connections are in use") from error

    async def _give_back(self, connection: DirectConnection) -> None:
        """Nothing here waits unless the connection is given up, so a cancelled block can, too."""
        if self._is_open and not connection.is_spent:
            self._places.put_nowait(connection)
            return
        self._places.put_nowait(None)
        await asyncio.shield(connection.close())
