"""The rules that a database breaks, for tests at a wall time of their own."""

from collections.abc import Sequence
from contextlib import AbstractAsyncContextManager
from datetime import UTC, datetime
from typing import Final, cast

from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.runtime.sql.database import Database
from skyway.runtime.verification.check import find_broken
from skyway.runtime.verification.rule import Rule

#: When the fixture `clock` begins.
_START: Final = datetime(2026, 3, 1, 12, tzinfo=UTC)


async def broken_rules(
    db: Database,
    rules: Sequence[Rule],
    *,
    wall_at: datetime = _START,
    fleet_at: datetime | None = None,
) -> list[tuple[str, str]]:
    """The name of each broken rule, with the subject that breaks it."""
    found = await find_broken(
        surveyed_soon(db), rules, wall_at=wall_at, fleet_at=fleet_at, pause=_no_pause
    )
    return [(each.rule, each.subject) for each in found]


def surveyed_soon(db: Database) -> Database:
    """A database whose surveys take little time in tests."""
    return cast("Database", _SurveyedInTheLoop(db)) if db.dialect == "sqlite" else db


class _SurveyedInTheLoop:
    """A SQLite database whose surveys run in the event loop.

    `Database.survey` runs each statement in a thread. A test's database has few rows, and the hops
    to the thread and back took half of the processor time of the stories about missions.
    """

    def __init__(self, db: Database) -> None:
        self._db = db
        self.dialect = db.dialect

    def survey(self) -> AbstractAsyncContextManager[AsyncConnection]:
        """A connection to read from. All reads see the data of one moment."""
        return self._db.read()


async def _no_pause() -> None:
    """The system of a test stands still."""
