"""What `skyway verify` finds in the databases of a running system, found in the test's process.

The command starts three processes. Their imports take ten times as long as the checks of a test's
system. The stories of cells, of rogues and of failing parts run the command itself.
"""

import asyncio
import tempfile
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Final

from skyway.cli.verify.drone_rules import RULES as ACROSS
from skyway.cli.verify.looks import ServiceLook, broken_across, still_broken
from skyway.runtime.sql.database import Database
from skyway.runtime.verification.check import check
from skyway.runtime.verification.rule import BrokenRule
from tests.verification.damaged_copies import FACTS, RULES

#: How long a running system needs to settle, seconds of wall time.
_SETTLES_WITHIN_S: Final = 2.0

_settle = partial(asyncio.sleep, _SETTLES_WITHIN_S)


async def broken_rules(urls: Mapping[str, str]) -> list[BrokenRule]:
    """The rules that a system breaks, whose databases have these URLs by service."""
    with tempfile.TemporaryDirectory() as scratch:
        first = await _look(urls, Path(scratch, "first"))
        own = [each for look in first.values() for each in look.broken]
        if not broken_across(ACROSS, first, first):
            return own
        await _settle()
        later = await _look(urls, Path(scratch, "later"))
        return own + still_broken(ACROSS, first, later)


async def _look(urls: Mapping[str, str], facts: Path) -> dict[str, ServiceLook]:
    """What each service says of its database; all databases are checked side by side."""
    looks = await asyncio.gather(*(_look_at(each, url, facts / each) for each, url in urls.items()))
    return {each.service: each for each in looks}


async def _look_at(service: str, url: str, facts: Path) -> ServiceLook:
    async with Database(url) as db:
        found = await check(
            db,
            RULES[service],
            FACTS[service],
            folder=facts,
            wall_at=datetime.now(UTC),
            fleet_at=None,
            pause=_settle,
        )
    return ServiceLook(service, tuple(found), facts)
