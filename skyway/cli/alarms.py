"""`skyway alarms`: what an operator must look at."""

import json
from typing import Annotated, Any, Final, Literal
from urllib.parse import quote

import typer

from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.gateway import call_gateway, fail

#: How many alarms are listed, the newest first.
_MOST_SHOWN: Final = 200

_Level = Literal["WARNING", "URGENT", "CRITICAL"]


def alarms_command(
    acknowledge: Annotated[
        str | None, typer.Option(metavar="ID", help="Acknowledge this alarm.")
    ] = None,
    note: Annotated[
        str | None, typer.Option(help="With --acknowledge: a remark for other operators.")
    ] = None,
    level: Annotated[_Level | None, typer.Option(help="Only alarms of this level.")] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Also alarms that are acknowledged.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the gateway's answer as JSON.")
    ] = False,
    data: DataOption = None,
) -> None:
    """List the open alarms, the newest first; acknowledge one."""
    folder = data_folder(data)
    if acknowledge is None and note is not None:
        fail("--note goes with --acknowledge")
    if acknowledge is not None:
        path = f"/v1/alarms/{quote(acknowledge, safe='')}/acknowledgements"
        found = [_call(folder, "POST", path, {} if note is None else {"note": note})]
    else:
        state = "" if everything else "&state=OPEN"
        only = "" if level is None else f"&level={level}"
        found = _call(folder, "GET", f"/v1/alarms?limit={_MOST_SHOWN}{state}{only}")["items"]
    if as_json:
        typer.echo(json.dumps(found, indent=2))
        return
    for each in found:
        typer.echo(_line(each))
    if not found:
        typer.echo("no alarms" if everything else "no open alarms")


def _line(alarm: dict[str, Any]) -> str:
    about = alarm["drone_id"] or alarm["mission_id"] or alarm["station_id"] or ""
    by = alarm["acknowledged_by"]
    parts = (
        alarm["alarm_id"],
        alarm["at"],
        alarm["level"],
        alarm["code"],
        about,
        alarm["detail"],
        f"(acknowledged by {by})" if by else "",
    )
    return "  ".join(part for part in parts if part)


def _call(folder: DataFolder, method: str, path: str, body: object = None) -> Any:  # any JSON
    encoded = None if body is None else json.dumps(body).encode()
    return call_gateway(method, path, folder=folder, body=encoded)
