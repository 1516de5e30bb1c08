"""The rules that a database breaks, for tests at a wall time of their own."""

from collections.abc import Sequence
from contextlib import AbstractAsyncContextManager
from datetime import UTC, datetime
from typing import Final

from skyway_verifier.check import Checked, check
from skyway_verifier.rule import Rule
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.runtime.sql.database import Database
from skyway.runtime.sql.read_only import Surveyed

#: When the fixture `clock` begins.
_START: Final = datetime(2026, 3, 1, 12, tzinfo=UTC)

#: The system of a test stands still.
NO_PAUSE: Final = (0.0,)


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
    return _SurveyedInTheLoop(db) if db.dialect == "sqlite" else db


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
