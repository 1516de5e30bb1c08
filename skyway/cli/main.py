"""The `skyway` command: one line per subcommand."""

import sys
from typing import NoReturn

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
    help="The open backend for drone-based multi-package delivery.",
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


def main() -> None:
    """Run a subcommand; what Skyway itself reports ends it with a message and code 1.

    So does a file that cannot be used: a wrong path is the commonest mistake of all.
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
