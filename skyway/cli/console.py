"""Ways to watch a running Skyway: `skyway console` in a browser, `skyway top` in a terminal."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from skyway.cli.data_folder import DataOption, data_folder
from skyway.cli.gateway import call_gateway, fail, gateway_and_key, read_keys


class ConsoleRole(StrEnum):
    """Whose key the console calls with; its name is the name of the key in keys.env."""

    OPERATOR = "operator"
    PROVIDER = "provider"
    CUSTOMER = "customer"


console_app = typer.Typer()


@console_app.callback(invoke_without_command=True)
def console_command(
    context: typer.Context,
    role: Annotated[
        ConsoleRole | None,
        typer.Option(
            help="Whose key the console calls with: SKYWAY_PROVIDER_KEY and so on. Without it the"
            " first that is set: operator, provider, customer."
        ),
    ] = None,
    data: DataOption = None,
) -> None:
    """Print a link to the console that logs a browser in once, within ten minutes."""
    if context.invoked_subcommand is not None:
        return
    key_name = None if role is None else f"SKYWAY_{role.name}_KEY"
    link = call_gateway("POST", "/v1/session-links", key_name=key_name, folder=data_folder(data))
    typer.echo(link["url"])


@console_app.command("base-map")
def base_map_command(
    file: Annotated[Path, typer.Argument(help="GeoJSON or PMTiles of a region.")],
    into: Annotated[Path, typer.Option(help="The folder that is made, for SKYWAY_CONSOLE_MAP.")],
    layer_property: Annotated[
        str, typer.Option(help="The property of a GeoJSON feature that names its layer.")
    ] = "layer",
    tolerance_m: Annotated[
        float,
        typer.Option(min=0, max=10_000, help="How far lines of GeoJSON may move, in metres."),
    ] = 20.0,
) -> None:
    """Make the folder of the console's base map from a GeoJSON or PMTiles file."""
    from skyway.cli.base_map import make_base_map

    shown = make_base_map(file, into, layer_property=layer_property, tolerance_m=tolerance_m)
    typer.echo(f"{into} shows: {', '.join(shown)}. Start with SKYWAY_CONSOLE_MAP={into}")


def top_command(
    once: Annotated[bool, typer.Option("--once", help="Print it once, for scripts.")] = False,
    data: DataOption = None,
) -> None:
    """Show a running Skyway on one screen: drones, missions, deliveries, alarms, lag."""
    from skyway.cli.top import NoAnswer, TopReader, watch

    folder = data_folder(data)
    url, key = gateway_and_key(folder)
    metrics_key = read_keys(folder).get("SKYWAY_METRICS_KEY")
    with TopReader(url, key=key, metrics_key=metrics_key) as reader:
        try:
            watch(reader, once=once)
        except NoAnswer as error:
            fail(str(error))
