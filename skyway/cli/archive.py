"""The command `skyway archive`: past rows as Parquet files, by the services that own them."""

import asyncio
import os
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Final

import typer

from skyway.cli.data_folder import DataOption, data_folder

#: The services that archive; the registry keeps its own history of telemetry.
_SERVICES: Final = ("gateway", "composition")


def archive_command(
    folder: Annotated[Path, typer.Argument(help="Where the files are: SERVICE/TABLE/DAY.parquet.")],
    data: DataOption = None,
) -> None:
    """Write each day that is over, and has no file yet, as Parquet files."""
    from skyway.cli.system.children import PACKAGES
    from skyway.cli.system.databases import database_urls
    from skyway.cli.system.supervisor import ProcessEnded
    from skyway.runtime.archive import WrittenDay

    own = data_folder(data)
    urls = asyncio.run(database_urls(own))
    for service in _SERVICES:
        clock = {"SKYWAY_CLOCK_FILE": str(own.clock_file)} if own.clock_file.exists() else {}
        environment = {**os.environ, **clock, "SKYWAY_DATABASE_URL": urls[service]}
        command = [sys.executable, "-m", PACKAGES[service], "archive"]
        done = subprocess.run(
            [*command, "--folder", str(folder / service)],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            detail = f"{service} was not archived:\n{done.stderr}"
            raise ProcessEnded(detail, exit_code=done.returncode)
        for line in done.stdout.splitlines():
            day = WrittenDay.read(line)
            typer.echo(f"{service} {day.table} {day.day}: {day.rows} rows")
