"""Calls of the commands for closures, with the operator's key."""

import json
from typing import Annotated, Any, Final
from urllib.parse import quote

import typer

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import call_gateway

OPERATOR_KEY: Final = "SKYWAY_OPERATOR_KEY"

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
    return call_gateway(method, path, key_name=OPERATOR_KEY, folder=folder, body=encoded)
