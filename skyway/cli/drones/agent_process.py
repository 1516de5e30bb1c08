"""Becoming the drone agent: this process goes on as `python -m skyway_drone_agent`."""

import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn, TypeGuard

import typer

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import fail, read_keys

_NEEDED = "SKYWAY_MQTT_URL"

#: Where the agent finds the cloud, if it has anything to ask there.
_PASSED = (_NEEDED, "SKYWAY_GATEWAY_URL")


def become_agent(
    folder: DataFolder, arguments: Sequence[str], *, told: Mapping[str, str] | None = None
) -> NoReturn:
    """Become the agent with these arguments, its journals in the data folder.

    `told` comes on top of the environment, which nobody else can read: secrets are no arguments.
    """
    folder.make()
    settings = read_keys(folder)
    if _NEEDED not in settings:
        fail(f"{_NEEDED} is not set, neither in the environment nor in {folder.keys_file}")
    environment = {
        **os.environ,
        **{name: settings[name] for name in _PASSED if name in settings},
        "SKYWAY_AGENT_JOURNAL": str(folder.journals),
        **(told or {}),
    }
    command = [sys.executable, "-m", "skyway_drone_agent", *arguments]
    # In place of this process, so that who ends this one ends the agent.
    os.execve(sys.executable, command, environment)  # noqa: S606 - there is no shell to want


#: Drones as the registry answers them in JSON: Any, since only it knows their members.
Drones = list[dict[str, Any]]


def read_drones(file: Path) -> Drones:
    """The drones in a file; ends the command when it holds none."""
    try:
        content = json.loads(file.read_text())
    except (OSError, ValueError) as error:
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
    """Write drones with their broker passwords, for this user's eyes only."""
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "w") as output:
        json.dump({"items": drones}, output)


def fly(folder: DataFolder, drones: Drones, arguments: list[str]) -> NoReturn:
    """Become the agent of these drones, until Ctrl-C."""
    folder.make()
    fleet_file = folder.path / f"fleet-{drones[0]['drone_id']}.json"
    write_drones(fleet_file, drones)
    typer.echo(f"{len(drones)} drones fly until Ctrl-C", err=True)
    become_agent(folder, ["--fleet", str(fleet_file), *arguments])
