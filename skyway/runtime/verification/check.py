"""Checks one database: its own rules, and what it says for the rules across services."""

from collections.abc import Awaitable, Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path

from skyway.runtime.sql.database import Database
from skyway.runtime.verification.fact_files import FactReader, read_facts, write_facts
from skyway.runtime.verification.find_broken import DAMAGED, find_broken, unreadable
from skyway.runtime.verification.rule import BrokenRule, Rule


async def check(
    db: Database,
    rules: Sequence[Rule],
    readers: Mapping[str, FactReader],
    *,
    folder: Path | None,
    wall_at: datetime,
    pause: Callable[[], Awaitable[None]],
) -> list[BrokenRule]:
    """Every rule that is broken; the facts are written below a new folder, if one is given.

    `pause` waits until a running system has settled.
    """
    broken = await find_broken(db, rules, wall_at=wall_at, pause=pause)
    if folder is None:
        return broken
    try:
        write_facts(await read_facts(db, readers, wall_at=wall_at), folder)
    except DAMAGED as error:
        broken.append(unreadable("the facts for other services", error))
    return broken
