"""`skyway network`: builds, shows, publishes and fetches networks, and says whether one is open."""

import json
import sys
from collections.abc import Iterator, Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn
from urllib.parse import quote

import typer

from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.gateway import call_gateway
from skyway.errors import SkywayError
from skyway.units import km_to_m, m_to_km

if TYPE_CHECKING:
    from skyway.network.network import Network

network_app = typer.Typer(help="Build, show, publish and fetch skyway networks.")

#: Exit code when a file or an option cannot be read, as in `skyway compose`.
EXIT_UNREADABLE = 2

#: The name to give instead of a file for the network that comes with Skyway.
BUNDLED = "bundled"

#: The id under which the bundled network is published when no id is given.
BUNDLED_NETWORK_ID = "texas-corridor"

_SEGMENT_KM = 20.0
_CITY_STATIONS = 100
_CITY_SEED = 1


_FileArgument = Annotated[
    str,
    typer.Argument(
        metavar="FILE",
        help="GeoJSON; - is standard input; 'bundled' is the network that comes with Skyway.",
    ),
]
_NetworkIdOption = Annotated[str, typer.Option("--network-id", help="The network's id.")]


class Kind(StrEnum):
    """What `build` can build."""

    TEXAS = "texas"
    CITY = "city"


@network_app.command()
def build(
    kind: Annotated[
        Kind, typer.Option(help="texas: the bundled corridor; city: a synthetic city.")
    ] = Kind.TEXAS,
    max_segment_km: Annotated[
        float | None,
        typer.Option(help=f"texas: the longest line of sight (default {_SEGMENT_KM:g})", min=0.0),
    ] = None,
    stations: Annotated[
        int | None, typer.Option(help=f"city: how many stations (default {_CITY_STATIONS})")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help=f"city: each seed gives another city (default {_CITY_SEED})")
    ] = None,
) -> None:
    """Write a network to standard output as GeoJSON."""
    from skyway.network.bundled import texas_corridor
    from skyway.network.geojson_text import network_text
    from skyway.network.synthetic import synthetic_city

    try:
        if kind is Kind.TEXAS:
            _refuse_options(kind, {"--stations": stations, "--seed": seed})
            longest_km = _SEGMENT_KM if max_segment_km is None else max_segment_km
            network = texas_corridor(max_segment_m=km_to_m(longest_km))
        else:
            _refuse_options(kind, {"--max-segment-km": max_segment_km})
            network = synthetic_city(
                stations=_CITY_STATIONS if stations is None else stations,
                seed=_CITY_SEED if seed is None else seed,
            )
    except SkywayError as error:
        _unreadable(str(error))
    typer.echo(network_text(network))


@network_app.command()
def show(file: _FileArgument = BUNDLED) -> None:
    """Print what a network holds and how well it is connected."""
    from rich.console import Console
    from rich.table import Table

    network = _read(file)
    table = Table("what", "value", title=file, show_header=False)
    for name, value in _facts(network):
        table.add_row(name, value)
    Console().print(table)


@network_app.command("import")
def publish(
    file: _FileArgument,
    network_id: Annotated[
        str | None,
        typer.Option(
            "--network-id", help=f"The network's id; 'bundled' needs none ({BUNDLED_NETWORK_ID})."
        ),
    ] = None,
    data: DataOption = None,
) -> None:
    """Publish a network on the running Skyway as a new version (needs the operator's key)."""
    from skyway.network.geojson_text import network_text

    if network_id is None:
        if file != BUNDLED:
            raise typer.BadParameter("a FILE needs an id", param_hint="--network-id")
        network_id = BUNDLED_NETWORK_ID
    text = network_text(_read(file))
    answer = call_gateway(
        "PUT",
        _path(network_id),
        folder=data_folder(data),
        body=text.encode(),
    )
    typer.echo(json.dumps(answer))


@network_app.command("export")
def fetch(network_id: _NetworkIdOption, data: DataOption = None) -> None:
    """Write a network of the running Skyway to standard output as GeoJSON."""
    answer = call_gateway(
        "GET",
        _path(network_id),
        folder=data_folder(data),
    )
    typer.echo(json.dumps(answer))


@network_app.command("status")
def show_status(network_id: _NetworkIdOption = BUNDLED_NETWORK_ID, data: DataOption = None) -> None:
    """Say whether a network of the running Skyway accepts deliveries now, and what restricts it."""
    answer = call_gateway(
        "GET",
        f"{_path(network_id)}/status",
        folder=data_folder(data),
    )
    for line in _status_lines(answer):
        typer.echo(line)


@network_app.command()
def weather(
    file: Annotated[
        str | None,
        typer.Argument(
            metavar="[FILE]",
            help="A forecast to use: JSON, or a NetCDF file (docs/weather.md); - is JSON from "
            "standard input. Without FILE the forecast in force is shown.",
        ),
    ] = None,
    source: Annotated[
        str | None,
        typer.Option(
            help="Of a NetCDF file: the name of the source, instead of the name in the file."
        ),
    ] = None,
    height_m: Annotated[
        float | None,
        typer.Option(help="Of a NetCDF file with the wind of several heights: metres, if not 10."),
    ] = None,
    remove: Annotated[
        bool, typer.Option("--remove", help="Plan in still air until drones measure wind.")
    ] = False,
    network_id: _NetworkIdOption = BUNDLED_NETWORK_ID,
    data: DataOption = None,
) -> None:
    """Give a network of the running Skyway a forecast, show the one in force, or remove it."""
    if remove and file is not None:
        raise typer.BadParameter("--remove takes no FILE")
    from skyway.cli.weather_file import NETCDF_SUFFIXES

    options = {"--source": source, "--height-m": height_m}
    given = [option for option, value in options.items() if value is not None]
    if given and not (file or "").lower().endswith(NETCDF_SUFFIXES):
        raise typer.BadParameter("it needs a NetCDF file", param_hint=given[0])
    folder = data_folder(data)
    body = None
    if file is not None:
        body = _forecast(file, network_id, source=source, height_m=height_m, folder=folder)
    answer = call_gateway(
        "DELETE" if remove else "GET" if file is None else "PUT",
        f"{_path(network_id)}/weather",
        folder=folder,
        body=body,
    )
    typer.echo(f"{network_id}: still air" if remove else _weather_line(answer))


def _forecast(
    file: str, network_id: str, *, source: str | None, height_m: float | None, folder: DataFolder
) -> bytes:
    """The forecast in a file as JSON; of a NetCDF file the part around the network's stations."""
    from skyway.cli.weather_file import GRIB_SUFFIXES, NETCDF_SUFFIXES, read_netcdf
    from skyway.network.geojson import read_network

    if file.lower().endswith(GRIB_SUFFIXES):
        _unreadable(f"{file}: GRIB files are not read: convert it to NetCDF with grib_to_netcdf")
    if not file.lower().endswith(NETCDF_SUFFIXES):
        return _text(file).encode()
    answer = call_gateway("GET", _path(network_id), folder=folder)
    try:
        stations = [each.position for each in read_network(answer).stations.values()]
        found = read_netcdf(file, stations=stations, source=source, height_m=height_m)
        return json.dumps(found).encode()
    except SkywayError as error:
        _unreadable(f"{file}: {error}")


def _weather_line(forecast: Mapping[str, Any]) -> str:
    spans = f"valid {forecast['valid_from_at']} to {forecast['valid_until_at']}"
    return (
        f"{forecast['network_id']}: {forecast['phase']}, from {forecast['source']}, issued "
        f"{forecast['issued_at']} ({forecast['age_s'] / 3600:.1f} h ago), {spans}, fades until "
        f"{forecast['fades_until_at']}"
    )


def _status_lines(status: Mapping[str, Any]) -> Iterator[str]:
    yield f"{status['network_id']}: {status['status']}"
    for each in status["restrictions"]:
        until = "" if each["until"] is None else f" (until {each['until']})"
        yield f"  {each['code']}: {each['detail']}{until}"
    if status["more_restrictions"]:
        yield f"  and {status['more_restrictions']} more"
    for each in status["models"]:
        line = f"  {each['model_id']}: {each['status']}"
        if each["registered"] is None:  # only operators see the counts
            yield line
        else:
            counts = f"{each['registered']} drones, {each['online']} online, {each['idle']} idle"
            yield f"{line}, {counts}"


def _refuse_options(kind: Kind, options: Mapping[str, float | None]) -> None:
    for option, value in options.items():
        if value is not None:
            raise typer.BadParameter(f"{option} has no meaning with --kind {kind}")


def _path(network_id: str) -> str:
    return f"/v1/networks/{quote(network_id, safe='')}"


def _read(file: str) -> "Network":
    """The network in this file; the command ends when the file holds none."""
    from skyway.network.bundled import texas_corridor
    from skyway.network.geojson_text import read_network_text

    if file == BUNDLED:
        return texas_corridor()
    try:
        return read_network_text(_text(file))
    except (ValueError, SkywayError) as error:
        _unreadable(f"{file}: {error}")


def _text(file: str) -> str:
    """The text in this file; the command ends when it cannot be read."""
    try:
        raw = sys.stdin.buffer.read() if file == "-" else Path(file).read_bytes()
        return raw.decode("utf-8-sig")
    except OSError as error:
        _unreadable(f"{file}: {error.strerror}")
    except UnicodeDecodeError:
        _unreadable(f"{file}: the text is not UTF-8")


def _unreadable(message: str) -> NoReturn:
    typer.echo(message, err=True)
    raise typer.Exit(EXIT_UNREADABLE)


def _facts(network: "Network") -> list[tuple[str, str]]:
    from skyway.network.components import component_sizes

    columns = network.columns
    facts = [
        ("stations", str(len(network.stations))),
        ("pads", str(int(columns.pads.sum()))),
        ("parking stations", str(len(columns.parking))),
        ("stations with opening hours", str(len(network.opening_hours))),
        ("stations with limited power", str(len(network.pad_powers.limited_w))),
        ("stations with connectors", str(len(network.pad_connectors.of_station))),
        ("segments (directed)", str(len(network.segments))),
        ("zones", str(len(network.zones))),
    ]
    if network.stations:
        degrees = network.outgoing.degrees()
        spread = f"{degrees.mean():.1f} on average, {degrees.min()} to {degrees.max()}"
        sizes = component_sizes(network)
        facts += [
            ("segments from a station", spread),
            ("components", f"{len(sizes)}, the largest of {max(sizes)} stations"),
        ]
    if network.segments:
        longest = network.segments[int(columns.length_m.argmax())]
        ends = f"{longest.from_id} to {longest.to_id}"
        facts.append(("longest segment", f"{m_to_km(longest.length_m):.1f} km, {ends}"))
    return facts
