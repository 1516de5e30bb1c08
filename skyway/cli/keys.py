"""Where the command line finds a running Skyway and the newcomer's keys to it."""

import os
import shlex
from collections.abc import Mapping

from skyway.cli.data_folder import DataFolder


def read_keys(folder: DataFolder) -> dict[str, str]:
    """The `SKYWAY_...` settings of the folder's keys.env; the environment's own ones win.

    A missing file holds nothing. Lines are ``NAME=value`` or ``export NAME=value``, as a shell
    reads them; anything else is passed over.
    """
    try:
        text = folder.keys_file.read_text(encoding="utf-8")
    except FileNotFoundError:
        text = ""
    return _assignments(text) | _settings(os.environ)


def _settings(variables: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in variables.items() if name.startswith("SKYWAY_")}


def _assignments(text: str) -> dict[str, str]:
    found = {}
    for line in text.splitlines():
        name, equals, value = line.strip().removeprefix("export ").partition("=")
        if equals and name.strip().isidentifier():
            found[name.strip()] = " ".join(shlex.split(value, comments=True))
    return found
