"""The rules that a database breaks, for tests at a wall time of their own."""

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Final

from skyway.runtime.sql.database import Database
from skyway.runtime.verification.check import find_broken
from skyway.runtime.verification.rule import Rule

#: When the fixture `clock` begins.
_START: Final = datetime(2026, 3, 1, 12, tzinfo=UTC)


async def broken_rules(
    db: Database, rules: Sequence[Rule], *, wall_at: datetime = _START
) -> list[tuple[str, str]]:
    """The name of each broken rule, with the subject that breaks it."""
    found = await find_broken(db, rules, wall_at=wall_at, pause=_no_pause)
    return [(each.rule, each.subject) for each in found]


async def _no_pause() -> None:
    """The system of a test stands still."""
