"""A connection to PostgreSQL that hands statements made once to the driver itself.

All else, such as statements that are made for one block, goes through SQLAlchemy, over the same
connection of the driver and so in the same transaction: SQLAlchemy's own is one that never ends,
and that the server never hears of, for to SQLAlchemy this connection commits by itself.
"""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from typing import Any, Final, Self, TypeVar, cast
from weakref import WeakKeyDictionary

from asyncpg import (
    Connection,
    IntegrityConstraintViolationError,
    InterfaceError,
    InternalClientError,
    PostgresError,
    Record,
)
from sqlalchemy import Executable
from sqlalchemy.engine import CursorResult
from sqlalchemy.exc import DBAPIError
from sqlalchemy.ext.asyncio import AsyncEngine

from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.sql.block_connection import BlockConnection
from skyway.runtime.sql.found import FoundRows
from skyway.runtime.sql.prepared import Prepared
from skyway.runtime.sql.written import Values, Written, WrittenStatements

AnswerT = TypeVar("AnswerT")

#: What the driver raises of its own; what SQLAlchemy wraps, too.
_DRIVER_ERRORS: Final = (PostgresError, InterfaceError, InternalClientError)

#: How long a server may take to end a cancelled statement before we hang up, seconds.
_FAREWELL_S: Final = 2.0


class DirectConnection(BlockConnection):
    """A connection of an engine that commits by itself; opened once, lent many times."""

    def __init__(self, engine: AsyncEngine, statements: WrittenStatements) -> None:
        super().__init__(engine)
        self._statements = statements
        self._prepared: WeakKeyDictionary[Written, Prepared] = WeakKeyDictionary()
        self._driver: Connection[Record]
        self._is_given_up = False
        self._begins_next = False
        self._has_begun = False

    @classmethod
    async def open(cls, engine: AsyncEngine, statements: WrittenStatements) -> Self:
        """Connect; the errors are SQLAlchemy's and the driver's."""
        connection = cls(engine, statements)
        await connection.start()
        connection._driver = (await connection.get_raw_connection()).driver_connection
        return connection

    @property
    def is_spent(self) -> bool:
        """Whether the next block needs another connection: this one is lost or in an odd state."""
        driver = self._driver
        return self._is_given_up or driver.is_closed() or driver.is_in_transaction()

    async def execute(
        self,
        statement: Executable,
        parameters: Values | Sequence[Values] | None = None,
        **options: Any,
    ) -> CursorResult[*tuple[Any, ...]]:
        """Run a statement; one that was run before goes to the driver as it was written then.

        Any: SQLAlchemy's own options, with which it is to run the statement itself.
        """
        await self._begin_if_due()
        rows = _rows(parameters)
        written = None
        if not options:
            written = self._statements.get(
                statement, rows[0], many=len(rows) > 1, dialect=self.dialect
            )
        if written is None:
            return await super().execute(statement, parameters, **options)
        try:
            arguments = [written.values(row) for row in rows]
        except KeyError:  # SQLAlchemy says which parameter is missing where
            return await super().execute(statement, parameters)
        # It answers what callers ask of SQLAlchemy's class, which needs a cursor of its own.
        return cast("CursorResult[*tuple[Any, ...]]", await self._run(written, arguments))

    async def execute_last(
        self, statement: Executable, parameters: Values
    ) -> CursorResult[*tuple[Any, ...]]:
        """Run a block's last statement; the only one is a transaction without BEGIN and COMMIT."""
        self._begins_next = False
        return await self.execute(statement, parameters)

    async def run_sync(self, fn: Callable[..., AnswerT], *arguments: Any, **named: Any) -> AnswerT:
        """As SQLAlchemy's; Any: what the function takes."""
        await self._begin_if_due()
        return await super().run_sync(fn, *arguments, **named)

    async def exec_driver_sql(
        self, statement: str, parameters: Any = None, execution_options: Any = None
    ) -> CursorResult[*tuple[Any, ...]]:
        """As SQLAlchemy's; Any: what the driver and SQLAlchemy take."""
        await self._begin_if_due()
        return await super().exec_driver_sql(statement, parameters, execution_options)

    @contextlib.asynccontextmanager
    async def transaction(self) -> AsyncIterator[None]:
        """Commit what is written within; after an error nothing of it is kept.

        It begins with the first statement: a block without any asks nothing of the server.

        Raises
        ------
        ServiceUnavailable
            The server did not commit.
        """
        self._begins_next, self._has_begun = True, False
        try:
            yield
        except BaseException:
            if self._has_begun:
                await self._undo()
            raise
        finally:
            self._begins_next = False
        # After an error PostgreSQL takes COMMIT for ROLLBACK, and is content.
        if self._has_begun and await self._control("COMMIT") != "COMMIT":
            raise ServiceUnavailable("database", "not committed after an error in a statement")

    @contextlib.asynccontextmanager
    async def one_moment(self) -> AsyncIterator[None]:
        """Have all statements within see one moment's data."""
        await self._control("BEGIN ISOLATION LEVEL REPEATABLE READ")
        try:
            yield
        finally:
            await self._undo()

    async def _run(self, written: Written, arguments: Sequence[Sequence[Any]]) -> FoundRows:
        """Any: the driver takes what columns take."""
        prepared = self._prepared.get(written)
        if prepared is None:
            statement = await self._answer(written.text, self._driver.prepare, written.text)
            prepared = Prepared(statement, written, dialect=self.dialect)
            self._prepared[written] = prepared
        try:
            if len(arguments) > 1:
                await self._answer(written.text, prepared.statement.executemany, arguments)
                return FoundRows((), status=None, returns_rows=False)
            records = await self._answer(written.text, prepared.statement.fetch, *arguments[0])
        except DBAPIError:
            # It may be a table that has changed since the statement was prepared.
            self._prepared.pop(written, None)
            raise
        return prepared.found(records)

    async def _begin_if_due(self) -> None:
        if self._begins_next:
            self._begins_next, self._has_begun = False, True
            await self._control("BEGIN")

    async def _control(self, text: str) -> str:
        """Run a statement without arguments, in the one message that it takes; what was done."""
        return await self._answer(text, self._driver.execute, text)

    async def _undo(self) -> None:
        """Roll back; when that cannot be said, the server does so because the connection goes."""
        if not self._is_given_up and not self._driver.is_closed():
            try:
                await self._control("ROLLBACK")
            except DBAPIError:
                self._driver.terminate()

    async def _answer(
        self, text: str, ask: Callable[..., Awaitable[AnswerT]], *arguments: Any
    ) -> AnswerT:
        """What the driver answers; its errors in SQLAlchemy's words. Any: what the driver takes.

        A connection whose statement was cancelled is not used again, since nobody knows how far
        that has come.
        """
        try:
            return await ask(*arguments)
        except _DRIVER_ERRORS as error:
            raise self._in_sqlalchemys_words(error, text) from error
        except asyncio.CancelledError:
            self._is_given_up = True
            await asyncio.shield(self._give_up())
            raise

    async def _give_up(self) -> None:
        """Close the connection; a statement that still runs is ended first, and its locks freed."""
        with contextlib.suppress(TimeoutError, OSError, *_DRIVER_ERRORS):
            await self._driver.close(timeout=_FAREWELL_S)

    def _in_sqlalchemys_words(self, error: Exception, text: str) -> Exception:
        """The error that SQLAlchemy would raise, without the refused row, which is private."""
        driver = self.dialect.loaded_dbapi
        is_refused = isinstance(error, IntegrityConstraintViolationError)
        kind = driver.IntegrityError if is_refused else driver.Error
        return DBAPIError.instance(
            text,
            None,
            kind(error.args[0], error),
            driver.Error,
            connection_invalidated=self._driver.is_closed(),
            dialect=self.dialect,
        )


def _rows(parameters: Values | Sequence[Values] | None) -> Sequence[Values]:
    """The sets of parameters for which a statement is run, one at least."""
    if not parameters:
        return ({},)
    return (parameters,) if isinstance(parameters, Mapping) else parameters
