"""A cloud service as a process: ``python -m PACKAGE [serve | migrate | verify]``.

Each command imports what it needs: `verify` takes a third of the time without the app.
"""

import argparse
import asyncio
import json
import sys
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from skyway.errors import SkywayError
from skyway.runtime.exit_codes import exit_code_of
from skyway.runtime.garbage import load_without_collecting
from skyway.runtime.logs import configure_logs
from skyway.runtime.settings import DatabaseSettings, ServiceSettings
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.violations import Violation

S = TypeVar("S", bound=ServiceSettings)


@dataclass(frozen=True, slots=True)
class ServiceProcess(Generic[S]):
    """What differs from one service's process to the next."""

    name: str
    package: str
    settings: type[S]
    #: Imports the app and serves it; returns the exit code.
    serve: Callable[[S], int]
    violations: Callable[[Database], Awaitable[Sequence[Violation]]]

    def run(self, arguments: Sequence[str] | None = None) -> int:
        """The exit code; 1 when `verify` found something."""
        commands = {"serve": self._serve, "migrate": self._migrate, "verify": self._verify}
        parser = argparse.ArgumentParser(prog=f"python -m {self.package}")
        parser.add_argument("command", nargs="?", default="serve", choices=sorted(commands))
        command = parser.parse_args(arguments).command
        try:
            return commands[command]()
        except SkywayError as error:
            sys.stderr.write(f"{self.package}: {error}\n")
            return exit_code_of(error)

    def _serve(self) -> int:
        settings = self.settings.load()
        configure_logs(self.name, settings.log_level)
        load_without_collecting()
        return self.serve(settings)

    def _migrate(self) -> int:
        from skyway.runtime.sql.migrations import migrate

        asyncio.run(migrate(DatabaseSettings.load().database_url, self.package))
        return 0

    def _verify(self) -> int:
        return asyncio.run(self._print_violations(DatabaseSettings.load().database_url))

    async def _print_violations(self, database_url: str) -> int:
        async with Database(database_url) as db:
            found = await self.violations(db)
        for violation in found:
            sys.stdout.write(json.dumps(violation) + "\n")
        return 1 if found else 0
