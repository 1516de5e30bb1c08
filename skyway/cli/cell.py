"""`skyway cell`: which server of composition serves which network."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from typing import Annotated, Any, Final
from urllib.parse import quote

import typer

from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.gateway import call_gateway, fail

cell_app = typer.Typer(help="Show, add, close and move the cells of networks.")

_OPERATOR_KEY: Final = "SKYWAY_OPERATOR_KEY"

_NetworkArgument = Annotated[str, typer.Argument(metavar="NETWORK", help="Id of the network.")]


@cell_app.command("list")
def list_command(data: DataOption = None) -> None:
    """List the networks that have a server of composition of their own."""
    cells = _call(data_folder(data), "GET", "")["items"]
    for each in cells:
        _show(each)
    if not cells:
        typer.echo("one composition serves all networks")


@cell_app.command("add")
def add_command(
    network: _NetworkArgument,
    url: Annotated[str, typer.Option(help="The SKYWAY_CELL_URL of its server.")],
    data: DataOption = None,
) -> None:
    """Give a network a server of its own; publish the network after that."""
    _show(_call(data_folder(data), "PUT", network, {"url": url}))


@cell_app.command("close")
def close_command(network: _NetworkArgument, data: DataOption = None) -> None:
    """Accept no new requests for a network; its missions are flown to their end."""
    _show(_call(data_folder(data), "PATCH", network, {"state": "CLOSED"}))


@cell_app.command("open")
def open_command(network: _NetworkArgument, data: DataOption = None) -> None:
    """Accept new requests for a network again."""
    _show(_call(data_folder(data), "PATCH", network, {"state": "OPEN"}))


@cell_app.command("copy")
def copy_command(
    source: Annotated[str, typer.Option("--from", help="URL of the old server's database.")],
    target: Annotated[str, typer.Option("--to", help="URL of the new server's database.")],
) -> None:
    """Seal and copy the database of an idle server, on a machine that reaches both databases.

    The sealed database refuses all changes: go on with `move`, or undo the seal with `unseal`.
    """
    typer.echo(_run_composition("copy", target, database=source, failed="nothing was copied"))
    typer.echo("the old database is sealed: go on with skyway cell move")


@cell_app.command("unseal")
def unseal_command(
    database: Annotated[str, typer.Option(help="URL of the sealed database.")],
) -> None:
    """Accept changes again in a database that was copied, for a cell that does not move."""
    typer.echo(_run_composition("unseal", database=database, failed="nothing was unsealed"))


@cell_app.command("move")
def move_command(
    network: _NetworkArgument,
    url: Annotated[str, typer.Option("--to", help="The SKYWAY_CELL_URL of the new server.")],
    data: DataOption = None,
) -> None:
    """Move a closed network to another server with a copy of its database, and open it again."""
    _show(_call(data_folder(data), "POST", f"{network}/moves", {"url": url}))
    typer.echo("the old server does nothing more: stop it when you like")


def _run_composition(*arguments: str, database: str, failed: str) -> str:
    """What a command of composition prints; `failed` begins the error if it fails."""
    from skyway.cli.system.children import PACKAGES

    done = subprocess.run(
        [sys.executable, "-m", PACKAGES["composition"], *arguments],
        env={**os.environ, "SKYWAY_DATABASE_URL": database},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        fail(f"{failed}: {done.stderr.strip()}", exit_code=done.returncode)
    return done.stdout.rstrip()


def _show(cell: dict[str, Any]) -> None:  # a cell as the gateway answers
    typer.echo(f"{cell['network_id']}  {cell['state']}  {cell['url']}")


def _call(  # Any: JSON, as the route says
    folder: DataFolder, method: str, path: str, body: Mapping[str, str] | None = None
) -> Any:
    below = f"/{quote(path)}" if path else ""
    return call_gateway(
        method,
        f"/v1/cells{below}",
        key_name=_OPERATOR_KEY,
        folder=folder,
        body=None if body is None else json.dumps(body).encode(),
    )
