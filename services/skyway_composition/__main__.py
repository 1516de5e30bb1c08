"""Runs composition: ``python -m skyway_composition [serve | migrate | verify | archive]``.

``python -m skyway_composition copy URL`` seals its database, and copies it into the database at the
URL. ``unseal`` lets a sealed database accept changes again.
"""

import asyncio
import sys
from collections.abc import Sequence
from typing import Final

from skyway.runtime.garbage import load_without_collecting

_PACKAGE: Final = "skyway_composition"


async def _copy(source_url: str, target_url: str) -> None:
    from skyway.runtime.sql.database import Database
    from skyway.runtime.sql.migrations import migrate
    from skyway_composition.copy_store import copy_database

    await migrate(target_url, _PACKAGE)
    async with Database(source_url) as source, Database(target_url) as target:
        for table, rows in (await copy_database(source, target)).items():
            sys.stdout.write(f"{table}: {rows} rows\n")


async def _unseal(database_url: str) -> None:
    from skyway.runtime.sql.database import Database
    from skyway_composition.seal_store import unseal

    async with Database(database_url) as db, db.write() as tx:
        was_sealed = await unseal(tx)
    sys.stdout.write(
        "the database accepts changes again\n" if was_sealed else "the database was not sealed\n"
    )


def _change_database(command: str, arguments: Sequence[str]) -> int:
    """Run `copy URL` or `unseal`; the exit code."""
    from skyway.runtime.errors import InvalidSettings
    from skyway.runtime.settings import DatabaseSettings

    own_url = DatabaseSettings.load().database_url
    if command == "copy" and len(arguments) == 1:
        asyncio.run(_copy(own_url, arguments[0]))
    elif command == "unseal" and not arguments:
        asyncio.run(_unseal(own_url))
    else:
        raise InvalidSettings("copy needs the URL of the other database, unseal none")
    return 0


def _run() -> int:
    from skyway.runtime.service_process import ServiceProcess, StoredData
    from skyway_composition.settings import CompositionSettings

    def serve(settings: CompositionSettings) -> int:
        from skyway.runtime.http.serving import serve
        from skyway_composition.app import build_app

        return serve(build_app(settings), settings)

    def data() -> StoredData:
        from skyway_composition.retention.archived_tables import ARCHIVED
        from skyway_composition.verify.rules import FACTS, RULES

        return StoredData(RULES, FACTS, ARCHIVED)

    return ServiceProcess("composition", _PACKAGE, CompositionSettings, serve, data).run()


def main() -> int:
    """Run the command; the exit code."""
    if sys.argv[1:2] in (["copy"], ["unseal"]):
        from skyway.runtime.errors import exit_code_after

        return exit_code_after(_PACKAGE, lambda: _change_database(sys.argv[1], sys.argv[2:]))
    load_without_collecting()
    return _run()


if __name__ == "__main__":
    sys.exit(main())
