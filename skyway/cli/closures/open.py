"""`skyway open`: lifts closures, and `skyway closures`, which lists them."""

import json
from typing import Annotated, Any, Final
from urllib.parse import quote

import typer

from skyway.cli.closures.operate import (
    GROUND_STOPS,
    ZONES,
    FromArgument,
    PadArgument,
    StationArgument,
    ToArgument,
    closure_line,
    operate,
    pad_path,
    segment_path,
    station_path,
)
from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.gateway import fail, gateway_and_key

open_app: Final = typer.Typer(
    help="Open what was closed: a station, a pad, a segment, a zone; end a ground stop.",
    no_args_is_help=True,
)

_TIMEOUT_S: Final = 30.0

ClosureArgument = Annotated[
    str, typer.Argument(metavar="ID", help="The id that `skyway closures` prints.")
]


@open_app.command("station")
def open_station(station: StationArgument, data: DataOption = None) -> None:
    """Lift all closures of a station."""
    _open_all(data_folder(data), station_path(station), f"station {station}")


@open_app.command("pad")
def open_pad(station: StationArgument, pad: PadArgument, data: DataOption = None) -> None:
    """Put a pad in order again."""
    _open_all(data_folder(data), pad_path(station, pad), f"pad {pad} of station {station}")


@open_app.command("segment")
def open_segment(from_id: FromArgument, to_id: ToArgument, data: DataOption = None) -> None:
    """Lift all closures of a segment in this direction."""
    path = segment_path(from_id, to_id)
    _open_all(data_folder(data), path, f"the segment from {from_id} to {to_id}")


@open_app.command("zone")
def open_zone(closure_id: ClosureArgument, data: DataOption = None) -> None:
    """Lift a zone that an operator has closed."""
    _lift(data_folder(data), ZONES, closure_id)


@open_app.command("ground-stop")
def open_ground(closure_id: ClosureArgument, data: DataOption = None) -> None:
    """End a ground stop."""
    _lift(data_folder(data), GROUND_STOPS, closure_id)


def closures_command(
    as_json: Annotated[bool, typer.Option("--json", help="Print them as JSON.")] = False,
    data: DataOption = None,
) -> None:
    """List what is closed now, or will be: stations, pads, segments, zones, ground stops."""
    closures = [*_all_closures(data_folder(data)).items()]
    found = [{"closure_id": closure_id, **closure} for closure_id, closure in closures]
    found.sort(key=lambda closure: (closure["from_at"], closure["closure_id"]))
    if as_json:
        typer.echo(json.dumps(found, indent=2))
        return
    for each in found:
        typer.echo(closure_line(each))
    if not found:
        typer.echo("nothing is closed")


def _open_all(folder: DataFolder, path: str, what: str) -> None:
    closures = operate(folder, "GET", f"{path}?limit=200")["items"]
    if not closures:
        fail(f"{what} is not closed")
    for each in closures:
        _lift(folder, path, each["closure_id"])


def _lift(folder: DataFolder, path: str, closure_id: str) -> None:
    operate(folder, "DELETE", f"{path}/{quote(closure_id, safe='')}")
    typer.echo(f"{closure_id} is lifted")


def _all_closures(folder: DataFolder) -> dict[str, Any]:
    """All closures by id, which the first event of the live picture holds."""
    import httpx

    url, key = gateway_and_key(folder)
    headers = {"Authorization": f"Bearer {key}"}
    live = f"{url}/v1/live?kinds=closures"
    try:
        with httpx.stream("GET", live, headers=headers, timeout=_TIMEOUT_S) as answer:
            answer.raise_for_status()
            events = (line[6:] for line in answer.iter_lines() if line.startswith("data: "))
            closures: dict[str, Any] = json.loads(next(events, "{}")).get("closures", {})
    except httpx.HTTPError as error:
        fail(f"no answer from {url}: {error}. Is `skyway up` running?")
    return closures
