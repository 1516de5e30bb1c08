"""The command `skyway verify`: what is broken in the databases, and what a person can do."""

import asyncio
import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Final

import typer

from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.gateway import fail
from skyway.cli.system.cells import cells_of
from skyway.errors import SkywayError

if TYPE_CHECKING:
    from skyway.runtime.verification.rule import BrokenRule

#: How long a running system needs to settle, seconds of wall time.
_SETTLES_WITHIN_S: Final = 2.0


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
    repair: Annotated[
        bool,
        typer.Option("--repair", help="Say what a person can do about each; nothing is changed."),
    ] = False,
) -> None:
    """Check all invariants of the databases; exit code 1 when one is violated."""
    from skyway.cli.system.databases import database_urls
    from skyway.cli.verify.looks import cell_name

    folder = data_folder(data)
    own = [*cells_of(folder)]
    urls = asyncio.run(database_urls(folder, own))
    of_cells = [*(urls.pop(name) for name in own), *(cells or ())]
    urls |= {cell_name(number): url for number, url in enumerate(of_cells, start=1)}
    for url in urls.values():
        _must_exist(url)
    try:
        with TemporaryDirectory(prefix="skyway-verify-") as scratch:
            found = _all_broken(folder, urls, Path(scratch))
    except SkywayError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(2) from error
    count = 0
    for where, broken in found.items():
        for each in broken:
            count += 1
            typer.echo(f"{where}: {json.dumps({'rule': each.rule, 'subject': each.subject})}")
            if repair:
                typer.echo(f"    {each.advice}")
    typer.echo(f"{count} violations in {len(urls)} databases")
    raise typer.Exit(1 if count else 0)


def _all_broken(
    folder: DataFolder, urls: Mapping[str, str], scratch: Path
) -> "dict[str, Sequence[BrokenRule]]":
    """The broken rules of each service, and of the services together."""
    from skyway.cli.verify.drone_rules import RULES
    from skyway.cli.verify.looks import broken_across, look, still_broken

    first = look(folder, urls, scratch / "first")
    found: dict[str, Sequence[BrokenRule]] = {
        service: look_at.broken for service, look_at in first.items()
    }
    if broken_across(RULES, first, first):
        time.sleep(_SETTLES_WITHIN_S)
        later = look(folder, urls, scratch / "later")
        found["across services"] = still_broken(RULES, first, later)
    return found


def _must_exist(url: str) -> None:
    """End the command when a SQLite file is missing; SQLite itself would create it."""
    file = url.removeprefix("sqlite:///")
    if file != url and not Path(file).exists():
        fail(f"there is no database {file}: no Skyway has run on this data folder")
