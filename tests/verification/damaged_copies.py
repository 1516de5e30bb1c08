"""Copies of a system's databases, damaged by SQL, and what `skyway verify` finds in them."""

import shutil
import sqlite3
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager, closing, contextmanager
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Final, Self

from skyway_composition.verify.rules import FACTS as COMPOSITION_FACTS
from skyway_composition.verify.rules import RULES as COMPOSITION_RULES
from skyway_gateway.verify.facts import FACTS as GATEWAY_FACTS
from skyway_gateway.verify.rules import RULES as GATEWAY_RULES
from skyway_provider_registry.verify import FACTS as REGISTRY_FACTS
from skyway_provider_registry.verify import RULES as REGISTRY_RULES

from skyway.cli.verify.drone_rules import RULES as ACROSS
from skyway.cli.verify.looks import ServiceLook, broken_across
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database
from skyway.runtime.verification.check import check
from skyway.runtime.verification.rule import BrokenRule
from tests.broken_rules import surveyed_soon

RULES: Final = {
    "gateway": GATEWAY_RULES,
    "composition": COMPOSITION_RULES,
    "registry": REGISTRY_RULES,
}
FACTS: Final = {
    "gateway": GATEWAY_FACTS,
    "composition": COMPOSITION_FACTS,
    "registry": REGISTRY_FACTS,
}

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
        self._sound: dict[str, ServiceLook] = {}
        self._looks = 0

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
                system._sound[service] = await system._look(service)
            yield system

    @property
    def urls(self) -> dict[str, str]:
        """The copies by service."""
        return {each: f"sqlite:///{self._scratch}/{each}.db" for each in RULES}

    async def broken(self, corruption: Corruption) -> list[BrokenRule]:
        """The rules that are broken after a corruption, which is undone."""
        looks = dict(self._sound)
        for service, script in corruption.scripts.items():
            with self.damaged(service, script):
                looks[service] = await self._look(service)
        own = [each for look in looks.values() for each in look.broken]
        return own + broken_across(ACROSS, looks, looks)

    async def looked_at_again(self) -> list[BrokenRule]:
        """The rules that are broken in the copies as they are now."""
        looks = {service: await self._look(service) for service in RULES}
        own = [each for look in looks.values() for each in look.broken]
        return own + broken_across(ACROSS, looks, looks)

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

    async def _look(self, service: str) -> ServiceLook:
        self._looks += 1
        folder = self._scratch / f"facts-{self._looks}"
        broken = await check(
            surveyed_soon(self._open[service]),
            RULES[service],
            FACTS[service],
            folder=folder,
            wall_at=self._wall_at,
            fleet_at=self._fleet_at,
            pause=_no_pause,
        )
        return ServiceLook(service, tuple(broken), folder)


async def _no_pause() -> None:
    """The system stands still."""
