"""Commands of operators that close and open stations, pads, segments, zones and the ground."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Final
from urllib.parse import quote

import typer

from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.gateway import call_gateway, check_answer, fail, open_answer
from skyway.cli.moments import moment_reader
from skyway.cli.outlook_text import delay_text
from skyway.json_text import json_value

ZONES: Final = "/v1/zones"
GROUND_STOPS: Final = "/v1/ground-stops"

StationArgument = Annotated[str, typer.Argument(help="A station.")]
PadArgument = Annotated[int, typer.Argument(min=0, help="The number of the pad, from 0.")]
FromArgument = Annotated[str, typer.Argument(metavar="FROM", help="Where the segment begins.")]
ToArgument = Annotated[str, typer.Argument(metavar="TO", help="Where the segment ends.")]


def station_path(station: str) -> str:
    """The closures of a station."""
    return f"/v1/stations/{quote(station, safe='')}/closures"


def pad_path(station: str, pad: int) -> str:
    """The outages of a pad."""
    return f"/v1/stations/{quote(station, safe='')}/pads/{pad}/outages"


def segment_path(from_id: str, to_id: str) -> str:
    """The closures of a segment."""
    return f"/v1/segments/{quote(from_id, safe='')}/{quote(to_id, safe='')}/closures"


def operate(folder: DataFolder, method: str, path: str, body: object = None) -> Any:
    """The gateway's answer; Any: the route documents its JSON."""
    encoded = None if body is None else json.dumps(body).encode()
    return call_gateway(method, path, folder=folder, body=encoded)


#: A JSON object of the gateway, whose members have no common type.
Document = Mapping[str, Any]


def closure_line(closure: Document) -> str:
    """One line: its id, what is closed, from when until when, and why."""
    until = closure.get("until")
    span = f"since {closure['from_at']}" if until is None else f"{closure['from_at']} to {until}"
    parts = (closure["closure_id"], _subject(closure), span, closure.get("reason"))
    return "  ".join(part for part in parts if part)


def _subject(closure: Document) -> str:
    match closure["kind"]:
        case "STATION":
            return f"station {closure['station_id']}"
        case "PAD":
            return f"station {closure['station_id']}, pad {closure['pad']}"
        case "SEGMENT":
            begins = closure.get("from_id") or closure["station_id"]
            return f"segment {begins} to {closure.get('to_id') or closure['to_station_id']}"
        case "ZONE":
            return f"zone in {closure['network_id']}"
        case _:
            return f"ground stop{_only(closure)}"


def _only(closure: Document) -> str:
    """Which drones a ground stop concerns, if not all."""
    names = ("network_id", "provider_id", "drone_model_id")
    only = [closure[name] for name in names if closure.get(name)]
    return f" of {', '.join(only)}" if only else ""


def affected_lines(made: Document) -> Iterator[str]:
    """A line for each mission that needs another plan, and their number."""
    missions = made["affected_missions"]
    for each in missions:
        where = each["station_id"] or "on its way"
        state = "flying" if each["is_flying"] else "not in the air"
        line = f"  {each['mission_id']}  {each['drone_id']}  {where}  {each['at']}  {state}"
        delay = each.get("delay")
        yield line if delay is None else f"{line}  {delay_text(delay)}"
    number = len(missions)
    is_one, is_dry = number == 1, made["closure_id"] is None
    needs = "would need" if is_dry else "needs" if is_one else "need"
    yield f"{number or 'no'} mission{'' if is_one else 's'} {needs} another plan"
    if is_dry and (left := made["missions_without_delay"]):
        yield f"delays were planned for the first {number - left} only"


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


open_app: Final = typer.Typer(
    help="Open what was closed: a station, a pad, a segment, a zone; end a ground stop.",
    no_args_is_help=True,
)

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
    live = "/v1/live?kinds=closures"
    with open_answer("GET", live, folder=folder) as answer:
        check_answer(answer, f"GET {live}")
        events = (line[6:] for line in answer.iter_lines() if line.startswith("data: "))
        closures: dict[str, Any] = json.loads(next(events, "{}")).get("closures", {})
    return closures
