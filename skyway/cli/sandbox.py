"""`skyway sandbox`: makes a test key, whose deliveries the sandbox plays."""

import json
from typing import Annotated

import typer

from skyway.cli.data_folder import DataOption, data_folder
from skyway.cli.gateway import call_gateway


def sandbox_command(
    name: Annotated[
        str | None, typer.Option(help="What people call the key, such as the job that uses it.")
    ] = None,
    data: DataOption = None,
) -> None:
    """Make a test key of the customer whose key is set, and print it.

    Deliveries with a test key are played by the sandbox within seconds (docs/sandbox.md).
    """
    body = {"livemode": False} | ({} if name is None else {"name": name})
    made = call_gateway(
        "POST",
        "/v1/keys",
        key_name="SKYWAY_CUSTOMER_KEY",
        body=json.dumps(body).encode(),
        folder=data_folder(data),
    )
    typer.echo(made["key"])
