"""Ways to watch a running Skyway: `skyway console` in a browser, `skyway top` in a terminal."""

from enum import StrEnum
from typing import Annotated

import typer

from skyway.cli.data_folder import DataOption, data_folder
from skyway.cli.gateway import call_gateway, fail, gateway_and_key, read_keys


class ConsoleRole(StrEnum):
    """Whose key the console calls with; its name is the name of the key in keys.env."""

    OPERATOR = "operator"
    PROVIDER = "provider"
    CUSTOMER = "customer"


def console_command(
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
    key_name = None if role is None else f"SKYWAY_{role.name}_KEY"
    link = call_gateway("POST", "/v1/session-links", key_name=key_name, folder=data_folder(data))
    typer.echo(link["url"])


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
