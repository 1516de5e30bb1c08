"""The drone agent: its options, files of drones for it, and this process that becomes it."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, NoReturn, TypeGuard

import typer

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import fail, needed_settings
from skyway.json_text import json_value

FileArgument = Annotated[
    Path | None,
    typer.Argument(metavar="[FILE]", help="The answer of POST /v1/providers/{id}/drones."),
]

EnrolOption = Annotated[
    str | None,
    typer.Option(
        metavar="TOKEN",
        envvar="SKYWAY_ENROLMENT_TOKEN",
        show_envvar=True,
        help="Exchange this token for the drone's credentials, once.",
    ),
]

ApiOption = Annotated[
    str | None,
    typer.Option(help="The gateway's URL; without it SKYWAY_GATEWAY_URL."),
]

RotateOption = Annotated[
    bool,
    typer.Option("--rotate", help="Rotate the credentials before the drone flies."),
]

ScenarioOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME|FILE", help="A day with wind and faults: calm, windy, stormy, ... or a file."
    ),
]

SeedOption = Annotated[
    int | None,
    typer.Option(min=0, help="The seed of the scenario; each seed is another day."),
]

FlightTimeOption = Annotated[
    float | None,
    typer.Option(help="Flight times are multiplied by this."),
]

FlightEnergyOption = Annotated[
    float | None,
    typer.Option(help="Flight energies are multiplied by this."),
]

ChargeTimeOption = Annotated[
    float | None,
    typer.Option(help="Recharge times are multiplied by this."),
]

AbsentOption = Annotated[
    list[str] | None,
    typer.Option(metavar="STATION", help="A station without a recipient; repeat it for more."),
]

VehicleOption = Annotated[
    str | None,
    typer.Option(
        metavar="mavlink:ADDRESS",
        help="The autopilot of a real drone, such as mavlink:udpin:127.0.0.1:14550.",
    ),
]

PayloadOption = Annotated[
    str | None,
    typer.Option(
        metavar="RELEASE",
        help="The package release of a real drone: gripper:NUMBER or servo:NUMBER:MICROSECONDS.",
    ),
]

AltitudeOption = Annotated[
    float | None, typer.Option(help="Of a real drone: metres above the take-off point.")
]

SystemIdOption = Annotated[
    int | None,
    typer.Option(
        help="Of a real drone: its MAVLink system id, if the link has several.", min=1, max=255
    ),
]

_BROKER: Final = "SKYWAY_MQTT_URL"
_DRONES_BROKER: Final = "SKYWAY_MQTT_DRONE_URL"

#: Settings of keys.env that the agent needs too.
_PASSED: Final[tuple[str, ...]] = (_BROKER, "SKYWAY_GATEWAY_URL")

#: Reads arguments as the agent reads them, and prints what is wrong with them.
_CHECK: Final = """
import os, sys
from skyway.errors import SkywayError
from skyway_drone_agent.settings import read_settings
try:
    read_settings(sys.argv[1:], os.environ)
except (SkywayError, OSError) as error:
    sys.exit(str(error))
"""

#: Drones as the registry answers them in JSON: Any, since only the registry defines the members.
Drones = list[dict[str, Any]]


def agent_arguments(options: dict[str, object], absent: list[str] | None) -> list[str]:
    """The options as arguments of the agent, without options that are not given."""
    given = [f"--{name}={value}" for name, value in options.items() if value is not None]
    return given + [f"--absent-station={station}" for station in absent or ()]


def read_drones(file: Path) -> Drones:
    """The drones in a file; the command ends when the file holds none."""
    try:
        content = json_value(file.read_bytes())
    except OSError as error:
        fail(f"{file} cannot be read: {error.strerror}")
    except ValueError as error:
        fail(f"{file} cannot be read: {error}")
    if isinstance(content, dict):
        content = content.get("items", [content])
    if not _are_drones(content):
        fail(f"{file} is not the answer of POST /v1/providers/{{id}}/drones")
    return content


def _are_drones(content: object) -> TypeGuard[Drones]:
    return (
        isinstance(content, list)
        and len(content) > 0
        and all(isinstance(drone, dict) and "drone_id" in drone for drone in content)
    )


def write_drones(file: Path, drones: Drones) -> None:
    """Write drones with their broker passwords; only this user can read the file."""
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "w") as output:
        json.dump({"items": drones}, output)


def check_agent_arguments(folder: DataFolder, arguments: Sequence[str]) -> None:
    """End the command when the agent would refuse these arguments or lacks a setting."""
    checked = subprocess.run(
        [sys.executable, "-c", _CHECK, *arguments],
        env=_environment(folder),
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    if checked.returncode:
        fail(checked.stderr.strip())


def fly(folder: DataFolder, drones: Drones, arguments: list[str]) -> NoReturn:
    """Become the agent of these drones, until Ctrl-C; its log is a file in the data folder."""
    folder.make()
    fleet_file = folder.path / f"fleet-{drones[0]['drone_id']}.json"
    write_drones(fleet_file, drones)
    log = os.environ.get("SKYWAY_AGENT_LOG", str(folder.log(fleet_file.stem).resolve()))
    typer.echo(f"{len(drones)} drones fly until Ctrl-C; their log is {log or 'here'}", err=True)
    passed = {"SKYWAY_AGENT_LOG": log}
    become_agent(folder, ["--fleet", str(fleet_file), *arguments], settings=passed)


def become_agent(
    folder: DataFolder, arguments: Sequence[str], *, settings: Mapping[str, str]
) -> NoReturn:
    """Become the agent with these arguments; its journals are in the data folder.

    `settings` are passed in the environment, and some are secret: other users of the machine can
    read arguments, but not the environment of this user's process.
    """
    folder.make()
    environment = {**_environment(folder), **settings}
    command = [sys.executable, "-m", "skyway_drone_agent", *arguments]
    # The agent replaces this process: a signal that ends this process ends the agent.
    os.execve(sys.executable, command, environment)  # noqa: S606 - no shell is needed


def _environment(folder: DataFolder) -> dict[str, str]:
    """The agent's environment; the command ends when no broker is named."""
    settings = needed_settings(folder, _BROKER)
    passed = {name: settings[name] for name in _PASSED if name in settings}
    # In a shell for `skyway up` the other setting names the listener of services.
    passed[_BROKER] = settings.get(_DRONES_BROKER) or passed[_BROKER]
    return {**os.environ, **passed, "SKYWAY_AGENT_JOURNAL": str(folder.journals)}
