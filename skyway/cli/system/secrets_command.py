"""`skyway secrets`: makes the files that the processes need where `skyway up` is not used."""

from pathlib import Path
from typing import Annotated

import typer

from skyway.cli.data_folder import DataOption, data_folder
from skyway.cli.gateway import fail
from skyway.cli.system.broker_files import make_drone_ca, write_mosquitto_files
from skyway.cli.system.secrets import (
    make_database_passwords,
    make_secrets,
    write_keys_file,
)


def secrets_command(
    gateway_url: Annotated[str, typer.Option(help="For keys.env.")] = "http://127.0.0.1:8000",
    mqtt_url: Annotated[str, typer.Option(help="For keys.env.")] = "mqtt://127.0.0.1:1883",
    mosquitto_host: Annotated[
        str, typer.Option(help="The address on which Mosquitto listens.")
    ] = "127.0.0.1",
    tls_name: Annotated[
        list[str] | None,
        typer.Option(
            metavar="HOST",
            help="A name or address of the broker; repeat it for more. Makes an authority that"
            " signs drones' certificates, and a TLS listener that requires them.",
        ),
    ] = None,
    postgres_host: Annotated[
        str | None, typer.Option(help="Make database passwords for this server.")
    ] = None,
    postgres_passwords: Annotated[
        Path | None, typer.Option(help="The folder in which that server finds them.")
    ] = None,
    data: DataOption = None,
) -> None:
    """Make the missing secrets, keys.env and Mosquitto's configuration."""
    if (postgres_host is None) != (postgres_passwords is None):
        fail("--postgres-host and --postgres-passwords go together")
    folder = data_folder(data)
    make_secrets(folder)
    write_keys_file(folder, gateway_url, mqtt_url)
    if tls_name:
        make_drone_ca(folder, tls_name)
    write_mosquitto_files(folder, host=mosquitto_host)
    if postgres_host is not None and postgres_passwords is not None:
        make_database_passwords(folder, postgres_passwords, host=postgres_host)
    typer.echo(f"secrets, keys.env and the broker's files are in {folder.path}", err=True)
