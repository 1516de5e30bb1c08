"""Runs the gateway: ``python -m skyway_gateway [serve | migrate | verify]``."""

import argparse
import asyncio
import json
import sys

from skyway.errors import SkywayError
from skyway.runtime.database import Database
from skyway.runtime.logs import configure_logs
from skyway.runtime.migrations import migrate
from skyway.runtime.serving import serve
from skyway.runtime.settings import DatabaseSettings
from skyway_gateway.app import PACKAGE, SERVICE, build_app
from skyway_gateway.settings import GatewaySettings
from skyway_gateway.verify import violations


def main() -> int:
    """The exit code: 2 when the environment is wrong, 1 when `verify` found something."""
    parser = argparse.ArgumentParser(prog=f"python -m {PACKAGE}")
    parser.add_argument("command", nargs="?", default="serve", choices=sorted(_COMMANDS))
    command = parser.parse_args().command
    try:
        return _COMMANDS[command]()
    except SkywayError as error:
        sys.stderr.write(f"{PACKAGE}: {error}\n")
        return 2


def _serve() -> int:
    settings = GatewaySettings.load()
    configure_logs(SERVICE, settings.log_level)
    return serve(build_app(settings), settings)


def _migrate() -> int:
    asyncio.run(migrate(DatabaseSettings.load().database_url, PACKAGE))
    return 0


def _verify() -> int:
    return asyncio.run(_print_violations(DatabaseSettings.load().database_url))


async def _print_violations(database_url: str) -> int:
    async with Database(database_url) as db:
        found = await violations(db)
    for violation in found:
        sys.stdout.write(json.dumps(violation) + "\n")
    return 1 if found else 0


_COMMANDS = {"serve": _serve, "migrate": _migrate, "verify": _verify}

if __name__ == "__main__":
    sys.exit(main())
