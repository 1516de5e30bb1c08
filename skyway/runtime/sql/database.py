"""A service's own database, used in the same way on SQLite and PostgreSQL.

`read` gives a connection that cannot write, `survey` a connection for long reads. `write` gives a
transaction, which is committed only by leaving its block, and `rehearse` one that is rolled back.
SQLite has one writer whose commits are grouped (`sqlite_writer`); on PostgreSQL each block has a
connection from a pool. `write_alone` is for a write of one statement.
"""

from collections.abc import AsyncIterator, Sequence
from contextlib import (
    AbstractAsyncContextManager,
    AsyncExitStack,
    asynccontextmanager,
    suppress,
)
from typing import Final, Self

from sqlalchemy import ColumnElement, Executable, Table, false, or_, select, text
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.loops import Wake
from skyway.runtime.sql.connection import AnyRow, Values
from skyway.runtime.sql.server_url import Dialect, read_url
from skyway.runtime.sql.storage import PostgresqlStorage, SqliteStorage, Storage
from skyway.runtime.sql.transaction import Tx
from skyway.runtime.sql.trouble import count_trouble

__all__ = ["Database", "Rest", "Tx"]


class _RehearsalOver(Exception):
    """Rolls a rehearsed transaction back."""


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
        self._storage: Storage | None = None

    async def __aenter__(self) -> Self:
        count_trouble(0)
        storage = (SqliteStorage if self.dialect == "sqlite" else PostgresqlStorage)(self._url)
        self._storage = await self._opened.enter_async_context(storage)
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._opened.aclose()
        self._storage = None

    def read(self) -> AbstractAsyncContextManager[AsyncConnection]:
        """A connection to read from. On SQLite all reads of a block see the data of one moment.

        On PostgreSQL each statement sees the data of its own moment.
        """
        return self._open().read()

    def survey(self) -> AbstractAsyncContextManager[AsyncConnection]:
        """A connection for long reads, which all see the data of one moment.

        On SQLite the event loop goes on while a statement runs.
        """
        return self._open().survey()

    @asynccontextmanager
    async def write(self) -> AsyncIterator[Tx]:
        """A transaction. When the block is left, all of it is on disk; after an error, nothing.

        Raises
        ------
        ServiceUnavailable
            The database could not be reached or did not commit.
        """
        async with self._open().write() as connection:
            tx = Tx(connection, dialect=self.dialect, outbox=self.outbox)
            yield tx
            channels = await tx.finish()
        for channel in channels:
            for wake in self._wakes.get(channel, ()):
                wake.set()
        tx.committed()

    @asynccontextmanager
    async def rehearse(self) -> AsyncIterator[Tx]:
        """A transaction that is rolled back when its block is left: nothing is stored or sent.

        It finds out what a change would do, with the code that makes the change.

        Raises
        ------
        ServiceUnavailable
            The database could not be reached.
        """
        with suppress(_RehearsalOver):
            async with self._open().write() as connection:
                yield Tx(connection, dialect=self.dialect, outbox=self.outbox)
                raise _RehearsalOver

    async def write_alone(
        self, statement: Executable, parameters: Values | Sequence[Values]
    ) -> Sequence[AnyRow]:
        """Run one statement as a transaction by itself; the rows that it returns.

        PostgreSQL then needs neither BEGIN nor COMMIT, two round trips of three.

        Raises
        ------
        ServiceUnavailable
            As for `write`; the statement may have been run.
        """
        async with self._open().write() as connection:
            done = await connection.execute_last(statement, parameters)
        return done.all() if done.returns_rows else ()

    @property
    def commits(self) -> int:
        """The number of commits that changed rows; 0 on PostgreSQL, which others write too."""
        return self._storage.commits if isinstance(self._storage, SqliteStorage) else 0

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

    def _open(self) -> Storage:
        if self._storage is None:
            raise ServiceUnavailable("database", "it is not open")
        return self._storage


#: After so many steps all loops look again, for changes by other programs.
_MOST_REST_STEPS: Final = 30


class Rest:
    """Whether loops may leave out their looks at the database, because they could find nothing.

    Only with SQLite: there this process makes all changes, and each of them ends the rest. So loops
    find nothing later than without a rest. Without `open_rows`, time alone makes no work.
    """

    def __init__(self, db: Database, open_rows: Sequence[ColumnElement[bool]]) -> None:
        self._db = db
        self._has_open_rows = select(or_(false(), *open_rows))
        self._seen = self._steps = -1
        self._has_begun = False

    @property
    def is_on(self) -> bool:
        """Whether loops may rest now."""
        return self._has_begun and self._seen == self._db.commits

    def end(self) -> None:
        """Let all loops look once more: something outside the database has changed."""
        self._has_begun, self._steps = False, _MOST_REST_STEPS

    async def step(self) -> bool:
        """Step of a loop: begin if nothing was changed since the step before; always False."""
        if self._seen != self._db.commits or self._steps == _MOST_REST_STEPS:
            self._has_begun, self._seen, self._steps = False, self._db.commits, -1
        self._steps += 1
        if self._steps == 1:
            async with self._db.read() as connection:
                has_open_rows = await connection.execute(self._has_open_rows)
            self._has_begun = not has_open_rows.scalar_one()
        return False
