"""Copies of a system's databases, damaged by SQL, and what `skyway verify` finds in them."""

import shutil
import sqlite3
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import AsyncExitStack, ExitStack, asynccontextmanager, closing, contextmanager
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Final, Self

from skyway_verifier.across.rules import ACROSS
from skyway_verifier.check import RULES, Checked, check, checked_as
from skyway_verifier.rule import BrokenRule

from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database
from tests.broken_rules import NO_PAUSE, surveyed_soon

#: Statements that change no rows.
_WITHOUT_ROWS: Final = ("CREATE", "DROP", "PRAGMA")


@dataclass(frozen=True, slots=True)
class Corruption:
    """A fault, the rule that must name it, and the SQL that makes it, by service.

    The SQL may name the ids of the system, such as `:flying`.
    """

    name: str
    rule: str
    gateway: str = ""
    composition: str = ""
    registry: str = ""

    @property
    def scripts(self) -> Mapping[str, str]:
        """The SQL by service, for the services that it changes."""
        every = {
            "gateway": self.gateway,
            "composition": self.composition,
            "registry": self.registry,
        }
        return {service: script for service, script in every.items() if script}


class StoppedSystem:
    """Copies of the databases of a stopped system, open so that statements are compiled once."""

    def __init__(
        self, databases: Path, ids: Mapping[str, str], scratch: Path, clock: FleetClock
    ) -> None:
        self._databases, self._ids = databases, ids
        # A call may be logged some time after its effect: a minute later everything has settled.
        self._wall_at = clock.wall_now() + timedelta(minutes=1)
        self._fleet_at = clock.now() + timedelta(minutes=1) * clock.rate
        self._scratch = scratch
        self._open: dict[str, Database] = {}

    @classmethod
    @asynccontextmanager
    async def opened(
        cls, databases: Path, ids: Mapping[str, str], scratch: Path, clock: FleetClock
    ) -> AsyncIterator[Self]:
        """Copy the databases into an empty folder, and open the copies."""
        system = cls(databases, ids, scratch, clock)
        async with AsyncExitStack() as stack:
            for service in RULES:
                shutil.copy(databases / f"{service}.db", scratch)
                db = await stack.enter_async_context(Database(system.urls[service]))
                system._open[service] = db
            yield system

    @property
    def urls(self) -> dict[str, str]:
        """The copies by service."""
        return {each: f"sqlite:///{self._scratch}/{each}.db" for each in RULES}

    async def broken(self, corruption: Corruption) -> list[BrokenRule]:
        """The rules that are broken after a corruption, which is undone.

        If one service's own rule must name the corruption, no other rule is checked.
        """
        with ExitStack() as damages:
            for service, script in corruption.scripts.items():
                damages.enter_context(self.damaged(service, script))
            own = {
                service: Checked(surveyed_soon(self._open[service]), rules)
                for service in corruption.scripts
                if (rules := [each for each in RULES[service] if each.name == corruption.rule])
            }
            return await self.looked_at_again(own)

    async def looked_at_again(self, only: Mapping[str, Checked] | None = None) -> list[BrokenRule]:
        """The rules that are broken in the copies as they are now: only these rules, or all."""
        databases = only or {
            name: checked_as(name, surveyed_soon(self._open[name])) for name in RULES
        }
        found = await check(
            databases, ACROSS, wall_at=self._wall_at, fleet_at=self._fleet_at, pauses_s=NO_PAUSE
        )
        assert not found.errors
        return [each for broken in found.broken.values() for each in broken]

    @contextmanager
    def damaged(self, service: str, script: str) -> Iterator[None]:
        """A copy after some statements; each must change a row or a part of the schema."""
        # As in the shell `sqlite3`, foreign keys are not checked.
        with closing(sqlite3.connect(self._scratch / f"{service}.db")) as copy:
            copy.execute("PRAGMA synchronous = OFF")
            for statement in filter(None, map(str.strip, script.split(";"))):
                changed = copy.execute(statement, self._ids).rowcount
                assert changed > 0 or statement.startswith(_WITHOUT_ROWS), statement
            copy.commit()
            yield
            with closing(sqlite3.connect(self._databases / f"{service}.db")) as sound:
                sound.backup(copy)
