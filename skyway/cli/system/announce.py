"""Announces a running system to the person who started it, until that person stops it."""

import asyncio
import io
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import GatewayApi
from skyway.cli.system.running_system import System
from skyway.cli.system.secrets import read_secret
from skyway.runtime.loops import stop_signals


class LastingOutput:
    """Standard output; once its reader is gone, the log `up.log`, so that stopping goes on."""

    def __init__(self, folder: DataFolder) -> None:
        self._folder = folder

    def write(self, text: str) -> None:
        """Write and flush."""
        try:
            sys.stdout.write(text)
            sys.stdout.flush()
        except OSError:
            self._folder.make()
            flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT
            log = os.open(self._folder.log("up"), flags, 0o600)
            for stream in (sys.stdout, sys.stderr):
                os.dup2(log, stream.fileno())
            if not isinstance(sys.stdout.buffer, io.BufferedWriter):
                sys.stdout.write(text)  # an unbuffered output has not kept the text
            sys.stdout.flush()

    def __getattr__(self, name: str) -> Any:  # any other member of standard output
        return getattr(sys.stdout, name)


@contextmanager
def asked_to_stop(console: Console) -> Iterator[asyncio.Event]:
    """An event that Ctrl-C, SIGTERM and SIGHUP set, so that everything ends in order."""
    asked = asyncio.Event()

    def stop(reason: str) -> None:
        if reason != signal.SIGINT.name:
            console.print(f"Skyway stops: {reason}.", markup=False)
        asked.set()

    with stop_signals(stop):
        yield asked


async def login_link(system: System) -> str:
    """A link to the console that logs the operator in once.

    Raises
    ------
    SkywayError
        The gateway refuses it.
    """
    key = read_secret(system.folder, "operator_key")
    async with GatewayApi(system.urls["gateway"]) as api:
        link = await api.call("POST", "/v1/session-links", key=key)
    return str(link["url"])


def announce(console: Console, system: System, *, link: str) -> None:
    """Print the addresses, keys and logs of the system, and a login link for the operator.

    The lines are not wrapped, because people copy addresses and paths from them.
    """
    rows = {
        "console": f"{link} (works once, for ten minutes; another one: skyway console)",
        "gateway": f"{system.urls['gateway']} (its pages: /docs)",
        "registry": system.urls["registry"],
        "composition": system.urls["composition"],
        "broker": system.mqtt_url,
        **{name: f"the composition of {network}" for name, network in system.cells.items()},
    }
    lines = [
        "Skyway is up:",
        *(f"  {name:<12} {text}" for name, text in rows.items()),
        f"Keys: source {system.folder.keys_file}    Logs: {system.folder.logs}    Stop: Ctrl-C",
    ]
    console.print("\n".join(lines), soft_wrap=True, markup=False, highlight=False)
