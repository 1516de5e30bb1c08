"""A cloud service as a process: ``python -m PACKAGE [serve | migrate | archive]``.

Each command imports what it needs: `serve` no archive, all others no app.
"""

import argparse
import asyncio
import logging
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, Generic, TypeVar

from skyway.runtime.errors import exit_code_after
from skyway.runtime.loading import keep_what_is_loaded
from skyway.runtime.settings import ArchiveSettings, DatabaseSettings, ServiceSettings

if TYPE_CHECKING:
    from skyway.runtime.archive import ArchivedTable

S = TypeVar("S", bound=ServiceSettings)

#: How long a busy event loop may keep its database threads from running, seconds. With Python's
#: 5 ms an answer waits twice as long for SQLite while others flood the service.
_SWITCH_INTERVAL_S: Final = 0.0005


@dataclass(frozen=True, slots=True)
class ServiceProcess(Generic[S]):
    """What differs from one service's process to the next."""

    name: str
    package: str
    settings: type[S]
    #: Imports the app and serves it; returns the exit code.
    serve: Callable[[S], int]
    #: Imports the tables that `archive` writes.
    archived: Callable[[], Sequence["ArchivedTable"]]

    def run(self, arguments: Sequence[str] | None = None) -> int:
        """The exit code."""
        parser = argparse.ArgumentParser(prog=f"python -m {self.package}")
        commands = ("migrate", "serve", "archive")
        parser.add_argument("command", nargs="?", default="serve", choices=commands)
        parser.add_argument("--folder", type=Path, help="of archive: where the files are")
        given = parser.parse_args(arguments)
        return exit_code_after(self.package, partial(self._run, given))

    def _run(self, given: argparse.Namespace) -> int:
        if given.command != "serve":
            keep_what_is_loaded()
        if given.command == "archive":
            return asyncio.run(self._archive(given.folder or Path("archive")))
        return self._migrate() if given.command == "migrate" else self._serve()

    def _serve(self) -> int:
        from skyway.runtime.tracing import LAST_ERRORS, configure_logs

        # Serving ends with the process, and so does the export of its spans.
        settings = self.settings.load()
        configure_logs(self.name, settings.log_level)
        logging.getLogger().addHandler(LAST_ERRORS)
        if settings.otlp_endpoint is not None:
            from skyway.runtime.tracing import export_spans

            export_spans(self.name, settings.otlp_endpoint)
        sys.setswitchinterval(_SWITCH_INTERVAL_S)
        return self.serve(settings)

    def _migrate(self) -> int:
        from skyway.runtime.sql.migrations import migrate

        asyncio.run(migrate(DatabaseSettings.load().database_url, self.package))
        return 0

    async def _archive(self, folder: Path) -> int:
        from skyway.runtime.archive import Export
        from skyway.runtime.clock import load_clock
        from skyway.runtime.sql.database import Database

        settings = ArchiveSettings.load()
        async with Database(settings.database_url) as db:
            export = Export(db, load_clock(settings.clock_file), folder)
            for each in await export.write(self.archived()):
                sys.stdout.write(each.model_dump_json() + "\n")
        return 0
