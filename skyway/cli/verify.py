"""The command `skyway verify`: what is broken in the databases, and what a person can do."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import unquote

import typer

from skyway.cli.data_folder import CLOUD_SERVICES, DataFolder, DataOption, data_folder
from skyway.cli.gateway import fail
from skyway.errors import InvalidInput, SkywayError

if TYPE_CHECKING:
    from skyway_verifier.check import Findings


def verify_command(
    data: DataOption = None,
    cells: Annotated[
        list[str] | None,
        typer.Option(
            "--cell",
            help="The URL of a further cell's database; once for each cell that is not of "
            "`skyway up --cell`.",
        ),
    ] = None,
    databases: Annotated[
        list[str] | None,
        typer.Option(
            "--database",
            metavar="SERVICE[=URL]",
            help="Check the database of this service, at this URL or at SKYWAY_DATABASE_URL, and "
            "no other one; once for each of gateway, composition and registry.",
        ),
    ] = None,
    repair: Annotated[
        bool,
        typer.Option("--repair", help="Say what a person can do about each; nothing is changed."),
    ] = False,
) -> None:
    """Check all invariants of the databases; exit code 1 when one is violated."""
    folder = data_folder(data)
    try:
        found = _findings(folder, _chosen(folder, databases or (), cells or ()))
    except SkywayError as error:
        fail(str(error), exit_code=2)
    count = 0
    for where, broken in found.broken.items():
        for each in broken:
            count += 1
            typer.echo(f"{where}: {json.dumps({'rule': each.rule, 'subject': each.subject})}")
            if repair:
                typer.echo(f"    {each.advice}")
    typer.echo(f"{count} violations in {found.checked} databases")
    for where, reason in found.errors.items():
        typer.echo(f"{where} could not be checked: {reason}", err=True)
    raise typer.Exit(2 if found.errors else 1 if count else 0)


def _chosen(folder: DataFolder, databases: Sequence[str], cells: Sequence[str]) -> dict[str, str]:
    """The URL of each database by its name: its service, or which cell it is of."""
    from skyway_verifier.rule import cell_name

    from skyway.cli.system.cells import cells_of
    from skyway.cli.system.databases import named_databases

    of_cells = [*cells]
    if databases:
        parts = (each.partition("=") for each in databases)
        chosen = {name: url or os.environ.get("SKYWAY_DATABASE_URL", "") for name, _, url in parts}
    else:
        own = [*cells_of(folder)]
        chosen = named_databases(folder, own)
        of_cells = [*map(chosen.pop, own), *cells]
    for name, url in chosen.items():
        if name not in CLOUD_SERVICES:
            known = ", ".join(CLOUD_SERVICES)
            raise InvalidInput("--database", f"{name!r} is not one of {known}")
        if not url:
            raise InvalidInput("--database", f"{name}: neither =URL nor SKYWAY_DATABASE_URL is set")
    return chosen | {cell_name(number): url for number, url in enumerate(of_cells, start=1)}


def _findings(folder: DataFolder, urls: Mapping[str, str]) -> "Findings":
    from skyway.runtime.clock import load_clock
    from skyway.runtime.loading import begin_loading, keep_what_is_loaded

    for url in urls.values():
        _must_exist(url)
    begin_loading()
    from skyway_verifier.check import verify

    keep_what_is_loaded()
    own, other = folder.clock_file, os.environ.get("SKYWAY_CLOCK_FILE")
    return verify(urls, load_clock(own if own.exists() else Path(other) if other else None))


def _must_exist(url: str) -> None:
    """End the command when a SQLite file is missing."""
    file = unquote(url.removeprefix("sqlite:///"))
    if url.startswith("sqlite:///") and not Path(file).exists():
        fail(f"there is no database {file}: no Skyway has run on this data folder")
