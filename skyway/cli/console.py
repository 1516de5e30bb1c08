"""`skyway console`: a link that logs a browser in to the console."""

from enum import StrEnum
from typing import Annotated

import typer

from skyway.cli.data_folder import DataOption, data_folder
from skyway.cli.gateway import call_gateway


class ConsoleRole(StrEnum):
    """Whose key the console calls with; its name is the name of the key in keys.env."""

    OPERATOR = "operator"
    PROVIDER = "provider"
    CUSTOMER = "customer"


def console_command(
    role: Annotated[
        ConsoleRole,
        typer.Option(help="Whose key the console calls with: SKYWAY_PROVIDER_KEY and so on."),
    ] = ConsoleRole.OPERATOR,
    data: DataOption = None,
) -> None:
    """Print a link to the console that logs a browser in once, within ten minutes."""
    key_name = f"SKYWAY_{role.name}_KEY"
    link = call_gateway("POST", "/v1/session-links", key_name=key_name, folder=data_folder(data))
    typer.echo(link["url"])
