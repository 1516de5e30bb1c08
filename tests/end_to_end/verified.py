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

#: Pauses in which a running system settles, seconds of wall time: the last for a slow machine.
_PAUSES_S: Final = (2.0, 8.0)

_settle = partial(asyncio.sleep, _PAUSES_S[0])


async def broken_rules(urls: Mapping[str, str]) -> list[BrokenRule]:
    """The rules that a system breaks, whose databases have these URLs by service."""
    with tempfile.TemporaryDirectory() as scratch:
        first = await _look(urls, Path(scratch, "first"))
        own = [each for look in first.values() for each in look.broken]
        across = broken_across(ACROSS, first, first)
        for number, pause_s in enumerate(_PAUSES_S if across else ()):
            await asyncio.sleep(pause_s)
            later = await _look(urls, Path(scratch, f"later-{number}"))
            across = still_broken(ACROSS, first, later)
            if not across:
                break
        return own + across


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
