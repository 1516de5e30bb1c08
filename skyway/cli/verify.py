"""`skyway verify`: the services check their databases side by side; this adds up."""

import asyncio
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import typer

from skyway.cli.data_folder import CLOUD_SERVICES, DataFolder, DataOption, data_folder
from skyway.cli.gateway import fail
from skyway.cli.system.children import PACKAGES
from skyway.cli.system.databases import database_urls

#: Seconds for one service; millions of rows take minutes, not hours.
_WITHIN_S = 600.0


def verify_command(data: DataOption = None) -> None:
    """Check all invariants of the databases; exit code 1 when one is violated."""
    folder = data_folder(data)
    urls = asyncio.run(database_urls(folder))
    for url in urls.values():
        _must_exist(url)
    with ThreadPoolExecutor() as threads:
        checks = threads.map(lambda service: _check(folder, service, urls[service]), CLOUD_SERVICES)
    violations = 0
    for service, checked in zip(CLOUD_SERVICES, checks, strict=True):
        found = checked.stdout.splitlines()
        for line in found:
            typer.echo(f"{service}: {line}")
        if checked.returncode not in (0, 1) or bool(found) != bool(checked.returncode):
            typer.echo(f"{service}: could not be checked:\n{checked.stderr}", err=True)
            raise typer.Exit(2)
        violations += len(found)
    typer.echo(f"{violations} violations in {len(CLOUD_SERVICES)} databases")
    raise typer.Exit(1 if violations else 0)


def _check(folder: DataFolder, service: str, url: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", PACKAGES[service], "verify"],
        env={
            **os.environ,
            "SKYWAY_DATABASE_URL": url,
            "SKYWAY_SECRETS_DIR": str(folder.secrets),
        },
        capture_output=True,
        text=True,
        timeout=_WITHIN_S,
        check=False,
    )


def _must_exist(url: str) -> None:
    """End the command when a SQLite file is missing; SQLite itself would create it."""
    file = url.removeprefix("sqlite:///")
    if file != url and not Path(file).exists():
        fail(f"there is no database {file}: no Skyway has run on this data folder")
