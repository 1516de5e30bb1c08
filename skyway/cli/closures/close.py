"""`skyway close`: closes a station, a pad, a segment or an area, or stops drones on the ground."""

import json
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from skyway.cli.closures.operate import (
    GROUND_STOPS,
    ZONES,
    FromArgument,
    PadArgument,
    StationArgument,
    ToArgument,
    affected_lines,
    closure_line,
    operate,
    pad_path,
    segment_path,
    station_path,
)
from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.gateway import fail
from skyway.cli.moments import moment_reader
from skyway.json_text import json_value

close_app: Final = typer.Typer(
    help="Close a station, a pad, a segment or an area; stop drones on the ground.",
    no_args_is_help=True,
)

_MOMENT: Final = "fleet time: 2026-03-02T14:00:00Z, or +2h30m from now"

FromOption = Annotated[
    str | None, typer.Option("--from", metavar="MOMENT", help=f"Closed from then; {_MOMENT}.")
]
UntilOption = Annotated[
    str | None, typer.Option(metavar="MOMENT", help=f"Closed until then; {_MOMENT}.")
]
ReasonOption = Annotated[str | None, typer.Option(help="Why, in words for people.")]
DryRunOption = Annotated[
    bool, typer.Option("--dry-run", help="Close nothing; show which missions it would delay.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the gateway's answer as JSON.")]
AreaArgument = Annotated[
    Path, typer.Argument(metavar="AREA", help="A file with a GeoJSON polygon.")
]


@close_app.command("station")
def close_station(
    station: StationArgument,
    from_at: FromOption = None,
    until: UntilOption = None,
    reason: ReasonOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
    data: DataOption = None,
) -> None:
    """Close a station: no drone lands there."""
    folder = data_folder(data)
    body = _times(folder, from_at, until) | _given(reason=reason)
    _close(folder, station_path(station), body, dry_run=dry_run, as_json=as_json)


@close_app.command("pad")
def close_pad(
    station: StationArgument,
    pad: PadArgument,
    from_at: FromOption = None,
    until: UntilOption = None,
    reason: ReasonOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
    data: DataOption = None,
) -> None:
    """Put a pad out of order: no drone charges there."""
    folder = data_folder(data)
    body = _times(folder, from_at, until) | _given(reason=reason)
    _close(folder, pad_path(station, pad), body, dry_run=dry_run, as_json=as_json)


@close_app.command("segment")
def close_segment(
    from_id: FromArgument,
    to_id: ToArgument,
    from_at: FromOption = None,
    until: UntilOption = None,
    reason: ReasonOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
    data: DataOption = None,
) -> None:
    """Close a segment in this direction."""
    folder = data_folder(data)
    body = _times(folder, from_at, until) | _given(reason=reason)
    _close(folder, segment_path(from_id, to_id), body, dry_run=dry_run, as_json=as_json)


@close_app.command("zone")
def close_zone(
    network: Annotated[str, typer.Argument(help="The network of the zone.")],
    area: AreaArgument,
    from_at: FromOption = None,
    until: UntilOption = None,
    reason: ReasonOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
    data: DataOption = None,
) -> None:
    """Close an area: no drone flies through it or lands in it."""
    folder = data_folder(data)
    body = _times(folder, from_at, until) | _given(reason=reason)
    body |= {"network_id": network, "area": _area(area)}
    _close(folder, ZONES, body, dry_run=dry_run, as_json=as_json)


@close_app.command("ground-stop")
def close_ground(
    reason: Annotated[str, typer.Option(help="Why, in words for people.")],
    network: Annotated[str | None, typer.Option(help="Only in this network.")] = None,
    area: Annotated[
        Path | None, typer.Option(help="Only at stations in this GeoJSON polygon.")
    ] = None,
    provider: Annotated[str | None, typer.Option(help="Only drones of this provider.")] = None,
    model: Annotated[str | None, typer.Option(help="Only drones of this model.")] = None,
    until: UntilOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
    data: DataOption = None,
) -> None:
    """Forbid drones to take off; drones in the air land as planned."""
    folder = data_folder(data)
    only = _given(network_id=network, provider_id=provider, drone_model_id=model)
    body = _times(folder, None, until) | only | {"reason": reason}
    if area is not None:
        body["area"] = _area(area)
    _close(folder, GROUND_STOPS, body, dry_run=dry_run, as_json=as_json)


def _close(
    folder: DataFolder, path: str, body: dict[str, Any], *, dry_run: bool, as_json: bool
) -> None:
    made = operate(folder, "POST", f"{path}?dry_run=true" if dry_run else path, body)
    if as_json:
        typer.echo(json.dumps(made, indent=2))
        return
    shown = {**made, "closure_id": made["closure_id"] or "would close"}
    typer.echo("\n".join((closure_line(shown), *affected_lines(made))))


def _times(folder: DataFolder, from_at: str | None, until: str | None) -> dict[str, Any]:
    read = moment_reader(folder)
    return _given(
        from_at=None if from_at is None else read(from_at, "--from"),
        until=None if until is None else read(until, "--until"),
    )


def _given(**members: str | None) -> dict[str, Any]:
    return {name: value for name, value in members.items() if value is not None}


def _area(file: Path) -> dict[str, Any]:
    """The polygon in a file of GeoJSON: a geometry, or a feature with one."""
    try:
        content = json_value(file.read_bytes())
    except ValueError as error:
        fail(f"{file}: {error}")
    if isinstance(content, dict) and content.get("type") == "Feature":
        content = content.get("geometry")
    if not isinstance(content, dict) or content.get("type") != "Polygon":
        fail(f"{file} holds no GeoJSON polygon")
    try:
        # Areas have no altitudes, which drawing programs often add.
        rings = [[place[:2] for place in ring] for ring in content["coordinates"]]
    except (KeyError, TypeError):
        fail(f"{file} holds a polygon without rings of positions")
    return {**content, "coordinates": rings}
