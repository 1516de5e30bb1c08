"""The rules that a database breaks, for tests at a wall time of their own."""

import sqlite3
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Any, Final, cast

from skyway_verifier.check import Checked, check
from skyway_verifier.rule import Rule
from sqlalchemy import Connection, CursorResult, Executable, NullPool, create_engine
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.read_only import Surveyed

#: When the fixture `clock` begins.
_START: Final = datetime(2026, 3, 1, 12, tzinfo=UTC)

#: The system of a test stands still.
NO_PAUSE: Final = (0.0,)

_file: Final[ContextVar[str]] = ContextVar("file")

#: Opens the SQLite file that `_file` names.
_engine: Final = create_engine(
    "sqlite://", creator=lambda: sqlite3.connect(_file.get()), poolclass=NullPool
)


async def broken_rules(
    db: Database,
    rules: Sequence[Rule],
    *,
    wall_at: datetime = _START,
    fleet_at: datetime | None = None,
) -> list[tuple[str, str]]:
    """The name of each broken rule, with the subject that breaks it."""
    checked = Checked(surveyed_soon(db), rules)
    found = await check({"db": checked}, wall_at=wall_at, fleet_at=fleet_at, pauses_s=NO_PAUSE)
    assert not found.errors
    return [(each.rule, each.subject) for each in found.broken["db"]]


def surveyed_soon(db: Database) -> Surveyed:
    """A database whose surveys take little time in tests."""
    return _PromptlySurveyed(db) if db.dialect == "sqlite" else db


class _PromptlySurveyed:
    """A SQLite database whose surveys never wait, so nothing changes while one lasts.

    A test's database has few rows: passing each statement from a rule to the event loop and to the
    driver took longer than the statement.
    """

    def __init__(self, db: Database) -> None:
        self._db = db
        self.dialect = db.dialect

    @asynccontextmanager
    async def survey(self) -> AsyncIterator[AsyncConnection]:
        """A connection to read from."""
        async with self._db.read() as opened:
            _file.set(str(opened.engine.url.database))
        with _engine.connect() as connection:
            yield cast("AsyncConnection", _Prompt(connection))


class _Prompt:
    """What `Survey` calls of an `AsyncConnection`. Any: columns have every type."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    async def execute(
        self, query: Executable, values: Mapping[str, Any] | None = None
    ) -> CursorResult[Any]:
        return self._connection.execute(query, values)

    async def exec_driver_sql(self, statement: str) -> CursorResult[Any]:
        return self._connection.exec_driver_sql(statement)

    @asynccontextmanager
    async def stream(self, query: Executable) -> AsyncIterator["_Prompt"]:
        self._found = self._connection.execute(query)
        yield self

    async def partitions(self, _size: int) -> AsyncIterator[Sequence[AnyRow]]:
        yield self._found.all()
