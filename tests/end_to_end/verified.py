"""What `skyway verify` finds in the databases of a running system, found in the test's process.

The command's imports take longer than the checks of a test's system. The stories of cells, of
rogues and of failing parts run the command itself.
"""

from collections.abc import Mapping
from contextlib import AsyncExitStack
from datetime import UTC, datetime
from typing import Final

from skyway_verifier.across.rules import ACROSS
from skyway_verifier.check import check, checked_as
from skyway_verifier.rule import BrokenRule

from skyway.runtime.sql.read_only import ReadOnlyDatabase

#: Pauses in which a running system settles, seconds of wall time: the last for a slow machine.
_PAUSES_S: Final = (2.0, 8.0)


async def broken_rules(urls: Mapping[str, str]) -> list[BrokenRule]:
    """The rules that a system breaks, whose databases have these URLs by service."""
    async with AsyncExitStack() as opened:
        databases = {
            name: checked_as(name, await opened.enter_async_context(ReadOnlyDatabase(url)))
            for name, url in urls.items()
        }
        found = await check(databases, ACROSS, wall_at=datetime.now(UTC), pauses_s=_PAUSES_S)
    assert not found.errors
    return [each for broken in found.broken.values() for each in broken]
