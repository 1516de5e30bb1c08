"""Runs composition: ``python -m skyway_composition [serve | migrate | verify | archive]``.

``python -m skyway_composition copy URL`` copies its database into the database at the URL.
"""

import asyncio
import sys
from collections.abc import Sequence
from typing import Final

from skyway.errors import SkywayError
from skyway.runtime.errors import exit_code_of
from skyway.runtime.service_process import ServiceProcess
from skyway_composition.retention.archived_tables import ARCHIVED
from skyway_composition.settings import CompositionSettings
from skyway_composition.verify.rules import FACTS, RULES

_PACKAGE: Final = "skyway_composition"


def _serve(settings: CompositionSettings) -> int:
    # Imported here: the other commands do without the app.
    from skyway.runtime.http.serving import serve
    from skyway_composition.app import build_app

    return serve(build_app(settings), settings)


def _copy(arguments: Sequence[str]) -> int:
    from skyway.runtime.settings import DatabaseSettings
    from skyway.runtime.sql.database import Database
    from skyway.runtime.sql.migrations import migrate
    from skyway_composition.copy_store import copy_database

    async def copy(target_url: str) -> None:
        await migrate(target_url, _PACKAGE)
        source_url = DatabaseSettings.load().database_url
        async with Database(source_url) as source, Database(target_url) as target:
            for table, rows in (await copy_database(source, target)).items():
                sys.stdout.write(f"{table}: {rows} rows\n")

    try:
        [target_url] = arguments
        asyncio.run(copy(target_url))
    except SkywayError as error:
        sys.stderr.write(f"{_PACKAGE}: {error}\n")
        return exit_code_of(error)
    except ValueError:
        sys.stderr.write(f"{_PACKAGE}: copy needs the URL of the other database\n")
        return 2
    return 0


if __name__ == "__main__":
    if sys.argv[1:2] == ["copy"]:
        sys.exit(_copy(sys.argv[2:]))
    process = ServiceProcess(
        "composition", _PACKAGE, CompositionSettings, _serve, RULES, FACTS, ARCHIVED
    )
    sys.exit(process.run())
