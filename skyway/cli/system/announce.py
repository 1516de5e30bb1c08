"""Announces a running system to the person who started it, until that person stops it."""

import asyncio
import signal
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console

from skyway.cli.gateway import GatewayApi
from skyway.cli.system.running_system import System
from skyway.cli.system.secrets import read_secret


@contextmanager
def asked_to_stop() -> Iterator[asyncio.Event]:
    """An event that Ctrl-C and SIGTERM set, so that everything ends in order."""
    asked = asyncio.Event()
    loop = asyncio.get_running_loop()
    numbers = (signal.SIGINT, signal.SIGTERM)
    for number in numbers:
        loop.add_signal_handler(number, asked.set)
    try:
        yield asked
    finally:
        for number in numbers:
            loop.remove_signal_handler(number)


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
        **{
            name: f"{url} (skyway cell add NETWORK --url={url})"
            for name, url in system.cells.items()
        },
    }
    lines = [
        "Skyway is up:",
        *(f"  {name:<12} {text}" for name, text in rows.items()),
        f"Keys: source {system.folder.keys_file}    Logs: {system.folder.logs}    Stop: Ctrl-C",
    ]
    console.print("\n".join(lines), soft_wrap=True, markup=False, highlight=False)
