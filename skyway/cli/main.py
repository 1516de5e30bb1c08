"""The `skyway` command: its subcommands, `--version`, and the printing of errors."""

import sys
from typing import Annotated, NoReturn

import typer

from skyway.cli.compose import compose_command
from skyway.cli.delivery import request_command, track_command
from skyway.cli.demo.command import demo_command
from skyway.cli.doctor import doctor_command
from skyway.cli.drones.drone import drone_command
from skyway.cli.drones.fleet import fleet_command
from skyway.cli.experiment import experiment_command
from skyway.cli.network import network_app
from skyway.cli.system.secrets_command import secrets_command
from skyway.cli.system.up import up_command
from skyway.cli.top.command import top_command
from skyway.cli.verify import verify_command
from skyway.errors import SkywayError

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command("up")(up_command)
app.command("demo")(demo_command)
app.command("compose")(compose_command)
app.command("experiment")(experiment_command)
app.command("request")(request_command)
app.command("track")(track_command)
app.command("drone")(drone_command)
app.command("fleet")(fleet_command)
app.command("top")(top_command)
app.command("secrets")(secrets_command)
app.command("verify")(verify_command)
app.command("doctor")(doctor_command)
app.add_typer(network_app, name="network")


def _print_version(is_asked: bool) -> None:
    if is_asked:
        # Imported here: no other command needs it.
        from importlib.metadata import version

        typer.echo(f"skyway {version('skyway')}")
        raise typer.Exit


@app.callback()
def _options(
    _version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=_print_version,
            is_eager=True,
            help="Print the version and exit.",
        ),
    ] = False,
) -> None:
    """The open backend for drone-based multi-package delivery."""


def main() -> None:
    """Run a subcommand.

    An error that Skyway reports ends it with a message and exit code 1. So does a file that cannot
    be used, because a wrong path is the most frequent mistake.
    """
    try:
        app()
    except SkywayError as error:
        _end(str(error))
    except OSError as error:
        if error.filename is None:
            raise
        _end(f"{error.filename}: {error.strerror}")


def _end(message: str) -> NoReturn:
    typer.echo(f"skyway: {message}", err=True)
    sys.exit(1)
