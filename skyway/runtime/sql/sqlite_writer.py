"""The only writer of a SQLite database: blocks one after another, many in one COMMIT.

A sync to disk costs more than many writes. While one COMMIT is under way, blocks queue up. They
then run one after another, each a savepoint of one transaction, and all are answered after its
single COMMIT. A block that fails rolls back to its own savepoint only. It gets its error only after
the COMMIT: then readers see the cause, such as a row that an earlier block has written.
"""

import asyncio
import contextlib
import logging
import sqlite3
from collections import deque
from collections.abc import AsyncIterator
from typing import Final, Self, cast

import aiosqlite
from sqlalchemy.engine import URL
from sqlalchemy.exc import DBAPIError
from sqlalchemy.ext.asyncio import AsyncConnection, AsyncEngine

from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.sql.sqlite_engines import sqlite_engine
from skyway.runtime.sql.trouble import named_trouble, spoils_connection, trouble_of_writing

log = logging.getLogger(__name__)

#: The most blocks in one COMMIT: the first of them waits for the last.
_LARGEST_GROUP: Final = 64


class _Turn:
    """One block's turn: granted by the writer, ended by the block, settled by the COMMIT."""

    def __init__(self) -> None:
        loop = asyncio.get_running_loop()
        self.owner = asyncio.current_task()
        self.granted: asyncio.Future[AsyncConnection] = loop.create_future()
        self.ended: asyncio.Future[bool] = loop.create_future()
        self.settled: asyncio.Future[None] = loop.create_future()

    @property
    def is_kept(self) -> bool:
        """Whether the block ended without an error, so that the COMMIT stores it."""
        return self.ended.done() and self.ended.result()

    def settle(self) -> None:
        """Let the block go on: what its group has written is on disk."""
        if not self.settled.done():
            self.settled.set_result(None)

    def refuse(self, error: ServiceUnavailable) -> None:
        """If the block still waits, give it the error that nothing of it is stored."""
        if not self.granted.done():
            self.granted.set_exception(error)
        elif not self.is_kept:
            self.settle()
        elif not self.settled.done():
            self.settled.set_exception(error)


class _NotCommitted(Exception):
    """A group was rolled back. Each of its blocks has got its error."""


class SqliteWriter:
    """Runs write blocks on one connection; `async with` starts and drains it."""

    def __init__(self, url: URL) -> None:
        self._engine: AsyncEngine = sqlite_engine(url)
        self._queue: deque[_Turn] = deque()
        self._arrived = asyncio.Event()
        self._is_closing = False
        self._running: _Turn | None = None
        self._is_spoilt = False  # the present connection
        self._changed_rows = 0  # by the present connection
        #: The number of commits that changed rows.
        self.commits = 0
        self._task: asyncio.Task[None] | None = None

    async def __aenter__(self) -> Self:
        # The first connection checks that this file can be written durably.
        with named_trouble(trouble_of_writing):
            async with self._engine.connect():
                pass
        self._is_closing = False
        self._task = asyncio.create_task(self._run(), name="sqlite writer")
        return self

    async def __aexit__(self, *_: object) -> None:
        self._is_closing = True
        self._arrived.set()
        if self._task is not None:
            await self._task
        await self._engine.dispose()

    @contextlib.asynccontextmanager
    async def block(self) -> AsyncIterator[AsyncConnection]:
        """A turn on the writing connection, left once its writes are on disk.

        Raises
        ------
        ServiceUnavailable
            The transaction could not begin or commit: nothing of this block is kept.
        """
        if self._is_closing or self._task is None:
            raise ServiceUnavailable("database", "it is not open")
        if self._running is not None and self._running.owner is asyncio.current_task():
            raise RuntimeError("a write block within a write block would wait for itself")
        turn = _Turn()
        self._queue.append(turn)
        self._arrived.set()
        try:
            yield await turn.granted
        except Exception as error:
            was_granted = self._running is turn
            self._is_spoilt |= was_granted and spoils_connection(error)
            self._end(turn, is_kept=False)
            if was_granted:
                await turn.settled
            raise
        except BaseException:
            self._end(turn, is_kept=False)
            raise
        self._end(turn, is_kept=True)
        await turn.settled

    def _end(self, turn: _Turn, *, is_kept: bool) -> None:
        if self._running is turn:
            self._running = None
        turn.ended.set_result(is_kept)

    async def _run(self) -> None:
        while await self._has_work():
            await self._serve()

    async def _has_work(self) -> bool:
        """Wait until a block has come; False when the writer is closing and none waits."""
        while not self._queue and not self._is_closing:
            self._arrived.clear()
            await self._arrived.wait()
        return bool(self._queue)

    async def _serve(self) -> None:
        """Commit groups on one connection until closing; after an error, close it for another."""
        self._is_spoilt = False
        try:
            async with self._engine.connect() as connection:
                try:
                    while not self._is_spoilt and await self._has_work():
                        await self._commit_group(connection)
                except BaseException:
                    self._is_spoilt = True
                    raise
                finally:
                    if self._is_spoilt:
                        await connection.invalidate()
        except _NotCommitted:
            pass  # Closing the connection rolled the group back. The blocks after it come next.
        except Exception as error:
            trouble = trouble_of_writing(error)
            if trouble is None:
                log.exception("sqlite cannot be written")
                trouble = ServiceUnavailable("database", "it cannot be written")
            while self._queue:
                self._queue.popleft().refuse(trouble)

    async def _commit_group(self, connection: AsyncConnection) -> None:
        group: list[_Turn] = []
        await _control(connection, "BEGIN IMMEDIATE")
        try:
            while self._queue and len(group) < _LARGEST_GROUP:
                group.append(self._queue.popleft())
                await self._run_block(group[-1], connection)
            driver = await _control(connection, "COMMIT")
        except (sqlite3.Error, DBAPIError, OSError) as error:
            reason = trouble_of_writing(error) or ServiceUnavailable("database", "not committed")
            for turn in group:
                turn.refuse(reason)
            raise _NotCommitted from error
        before, self._changed_rows = self._changed_rows, driver.total_changes
        self.commits += before != self._changed_rows
        for turn in group:
            turn.settle()

    async def _run_block(self, turn: _Turn, connection: AsyncConnection) -> None:
        """Let one block run within a savepoint. If the block fails, roll back to the savepoint."""
        if turn.granted.done():
            return  # its task was cancelled while it waited
        # Savepoints are not released: the COMMIT does that. The innermost is this block's.
        await _control(connection, "SAVEPOINT block")
        if turn.granted.done():
            return
        self._running = turn
        turn.granted.set_result(connection)
        await turn.ended
        if not turn.is_kept:
            await _control(connection, "ROLLBACK TO block")


async def _control(connection: AsyncConnection, statement: str) -> aiosqlite.Connection:
    """Run BEGIN, SAVEPOINT or COMMIT in one hop to the driver's thread, past SQLAlchemy."""
    driver = (await connection.get_raw_connection()).driver_connection
    if driver is None:
        raise sqlite3.OperationalError("the writing connection is gone")
    await driver.execute_fetchall(statement)
    return cast("aiosqlite.Connection", driver)
