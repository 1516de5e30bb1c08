"""The `skyway` command: its subcommands, `--version`, and the printing of errors."""

import sys
from importlib import import_module
from typing import Annotated, Any, Final

import typer
from typer.core import TyperGroup

from skyway.runtime.errors import exit_code_after

#: What runs each subcommand, in this package.
_COMMANDS: Final = {
    "up": "up:up_command",
    "demo": "demo.command:demo_command",
    "compose": "compose:compose_command",
    "dispatch": "dispatch:dispatch_command",
    "experiment": "experiment:experiment_command",
    "quote": "quote:quote_command",
    "accept": "delivery:accept_command",
    "request": "delivery:request_command",
    "track": "delivery:track_command",
    "recipient": "recipient:recipient_command",
    "drone": "drones.drone:drone_command",
    "fleet": "drones.fleet:fleet_command",
    "register": "drones.register:register_app",
    "battery": "drones.upkeep:battery_app",
    "maintenance": "drones.upkeep:maintenance_app",
    "console": "console:console_app",
    "sandbox": "sandbox:sandbox_command",
    "alarms": "alarms:alarms_command",
    "mission": "mission:mission_app",
    "closures": "closures:closures_command",
    "close": "closures:close_app",
    "open": "closures:open_app",
    "top": "console:top_command",
    "schedule": "schedule:schedule_command",
    "quarantine": "quarantine:quarantine_command",
    "secrets": "system.secrets:secrets_command",
    "nats": "system.nats_files:nats_command",
    "archive": "archive:archive_command",
    "verify": "verify:verify_command",
    "doctor": "doctor:doctor_command",
    "network": "network:network_app",
    "api": "api:api_command",
}

#: The first line of the help of each subcommand.
_SUMMARIES: Final = {
    "up": "Start all processes and keep them running until Ctrl-C.",
    "demo": "Play the paper's scenario through real processes, and end.",
    "compose": "Compose a plan for each problem in a file.",
    "dispatch": "Plan all open requests of a fleet together.",
    "experiment": "Measure the planner against the paper's strategies; write a page, figures and "
    "CSV files.",
    "quote": "Ask what providers offer for a delivery request; the best offer comes first.",
    "accept": "Accept an offer and print the id of its delivery.",
    "request": "Request a delivery and print its id.",
    "track": "Print what happens to a delivery, in fleet time, until it ends.",
    "recipient": "Follow tracking pages like a recipient, and prove each hand-over of a drone.",
    "drone": "Run the agent of one drone until Ctrl-C.",
    "fleet": "Run many simulated drones in one agent process until Ctrl-C.",
    "register": "Register the drones or batteries of a CSV file, or only check its rows.",
    "battery": "Register batteries, and note which drone each is in.",
    "maintenance": "Set when drones are due for maintenance, list those that are, record what was "
    "done.",
    "console": "Print a link to the console that logs a browser in once, within ten minutes.",
    "sandbox": "Make a test key of the customer whose key is set, and print it.",
    "alarms": "List the open alarms, the newest first; acknowledge one.",
    "mission": "Command a mission: hold, resume, divert, return home, cancel, give up.",
    "closures": "List what is closed now, or will be: stations, pads, segments, zones, ground "
    "stops.",
    "close": "Close a station, a pad, a segment or an area; stop drones on the ground.",
    "open": "Open what was closed: a station, a pad, a segment, a zone; end a ground stop.",
    "top": "Show a running Skyway on one screen: drones, missions, deliveries, alarms, lag.",
    "schedule": "Draw the calendars of drones, or of a station's pads: a line for each, in fleet "
    "time.",
    "quarantine": "List the messages of drones that were not taken, the newest first; replay or "
    "delete one.",
    "secrets": "Make the missing secrets, keys.env and Mosquitto's configuration.",
    "nats": "Write a folder for each node of NATS, with its configuration and its certificates.",
    "archive": "Write each day that is over, and has no file yet, as Parquet files.",
    "verify": "Check all invariants of the databases; exit code 1 when one is violated.",
    "doctor": "Ask database, broker and gateway, and say what is missing; exit code 1 when "
    "something is.",
    "network": "Build, show, publish and fetch skyway networks.",
    "api": "Call any route of the REST API, and print its answer.",
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


class _Commands(TyperGroup):
    """Imports the module of a subcommand when it is called: the list of all needs none of them."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # Typer keeps the types private
        """The name of the subcommand that is called, the subcommand, and its arguments."""
        name, _, rest = super().resolve_command(ctx, args)
        return name, _load(str(name)), rest


def _plain_app(**options: Any) -> typer.Typer:
    """An app without boxes and colours: rich would double the time until a help text appears."""
    return typer.Typer(
        add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None, **options
    )


def _load(name: str) -> Any:  # a command, whose class Typer keeps private
    """Import a subcommand."""
    module, _, member = _COMMANDS[name].partition(":")
    found = getattr(import_module(f"skyway.cli.{module}"), member)
    app = _plain_app()
    if isinstance(found, typer.Typer):
        app.add_typer(found, name=name)
    else:
        app.command(name)(found)
    app.callback()(_options)
    command = typer.main.get_group(app).commands[name]
    if isinstance(command, TyperGroup):
        for each in command.commands.values():
            each.short_help = str(each.help).partition("\n")[0]  # else Typer cuts a long line
    return command


def make_app() -> typer.Typer:
    """The command with all its subcommands."""
    app = _plain_app(cls=_Commands, no_args_is_help=True)
    app.callback()(_options)
    for name, summary in _SUMMARIES.items():
        app.command(name, short_help=summary)(_options)
    return app


def main() -> None:
    """Run a subcommand.

    An error that Skyway reports ends it with a message and the error's own exit code, or 1. So does
    a file that cannot be used, because a wrong path is the most frequent mistake.
    """
    sys.exit(exit_code_after("skyway", make_app()))
