"""Calls of the commands for closures, and closures as text."""

import json
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final
from urllib.parse import quote

import typer

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import call_gateway
from skyway.cli.outlook_text import delay_text

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
