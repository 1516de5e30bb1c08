"""Becoming the drone agent: this process goes on as `python -m skyway_drone_agent`."""

import os
import sys
from collections.abc import Mapping, Sequence
from typing import NoReturn

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import fail
from skyway.cli.keys import read_keys

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
