"""The `skyway` command: its subcommands, `--version`, and the printing of errors."""

import sys
from collections.abc import Iterable
from importlib import import_module
from typing import Annotated, Final

import typer

from skyway.runtime.errors import exit_code_after

#: Each subcommand, and what runs it.
_COMMANDS: Final = {
    "up": "skyway.cli.up:up_command",
    "demo": "skyway.cli.demo.command:demo_command",
    "compose": "skyway.cli.compose:compose_command",
    "dispatch": "skyway.cli.dispatch:dispatch_command",
    "experiment": "skyway.cli.experiment:experiment_command",
    "quote": "skyway.cli.quote:quote_command",
    "accept": "skyway.cli.delivery:accept_command",
    "request": "skyway.cli.delivery:request_command",
    "track": "skyway.cli.delivery:track_command",
    "drone": "skyway.cli.drones.drone:drone_command",
    "fleet": "skyway.cli.drones.fleet:fleet_command",
    "battery": "skyway.cli.drones.upkeep:battery_app",
    "maintenance": "skyway.cli.drones.upkeep:maintenance_app",
    "console": "skyway.cli.console:console_command",
    "alarms": "skyway.cli.alarms:alarms_command",
    "mission": "skyway.cli.mission:mission_app",
    "closures": "skyway.cli.closures.open:closures_command",
    "close": "skyway.cli.closures.close:close_app",
    "open": "skyway.cli.closures.open:open_app",
    "top": "skyway.cli.top:top_command",
    "schedule": "skyway.cli.schedule:schedule_command",
    "cell": "skyway.cli.cell:cell_app",
    "quarantine": "skyway.cli.quarantine:quarantine_command",
    "secrets": "skyway.cli.system.secrets:secrets_command",
    "nats": "skyway.cli.system.nats_files:nats_command",
    "archive": "skyway.cli.archive:archive_command",
    "verify": "skyway.cli.verify.command:verify_command",
    "doctor": "skyway.cli.doctor:doctor_command",
    "network": "skyway.cli.network:network_app",
}


def _print_version(is_asked: bool) -> None:
    if is_asked:
        # Imported here: no other command needs it.
        from importlib.metadata import version

        typer.echo(f"skyway {version('skyway')}")
        raise typer.Exit


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


def make_app(commands: Iterable[str] = tuple(_COMMANDS)) -> typer.Typer:
    """The command with these subcommands, whose modules are imported now."""
    app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)
    app.callback()(_options)
    for name in commands:
        module, _, member = _COMMANDS[name].partition(":")
        command = getattr(import_module(module), member)
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=name)
        else:
            app.command(name)(command)
    return app


def main() -> None:
    """Run a subcommand.

    An error that Skyway reports ends it with a message and the error's own exit code, or 1. So does
    a file that cannot be used, because a wrong path is the most frequent mistake.
    """
    # One subcommand needs a third of the time to start that all of them need.
    given = [name for name in sys.argv[1:2] if name in _COMMANDS]
    sys.exit(exit_code_after("skyway", make_app(given or _COMMANDS)))
