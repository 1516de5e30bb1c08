"""`skyway quarantine`: the messages of drones that were not taken."""

import json
from typing import Annotated, Any, Final
from urllib.parse import quote

import typer

from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.gateway import call_gateway, fail

#: How many messages are listed, the newest first.
_MOST_SHOWN: Final = 200


def quarantine_command(
    replay: Annotated[
        str | None, typer.Option(metavar="ID", help="Handle this message again.")
    ] = None,
    delete: Annotated[str | None, typer.Option(metavar="ID", help="Delete this message.")] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the gateway's answer as JSON.")
    ] = False,
    data: DataOption = None,
) -> None:
    """List the messages of drones that were not taken, the newest first; replay or delete one."""
    if replay is not None and delete is not None:
        fail("give only one of --replay and --delete")
    folder = data_folder(data)
    if replay is not None:
        _call(folder, "POST", f"/v1/quarantine/{quote(replay, safe='')}/replay")
        return
    if delete is not None:
        _call(folder, "DELETE", f"/v1/quarantine/{quote(delete, safe='')}")
        return
    items = _call(folder, "GET", f"/v1/quarantine?limit={_MOST_SHOWN}")["items"]
    if as_json:
        typer.echo(json.dumps(items, indent=2))
        return
    for each in items:
        typer.echo(_line(each))
    if not items:
        typer.echo("the quarantine is empty")


def _line(message: dict[str, Any]) -> str:
    return (
        f"{message['quarantine_id']}  {message['last_received_at']}  {message['times']} x  "
        f"{message['reason']}  {message['topic']}  {message['detail']}"
    )


def _call(folder: DataFolder, method: str, path: str) -> Any:  # any JSON, as the route says
    return call_gateway(method, path, folder=folder)
