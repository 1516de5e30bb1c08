"""`skyway top`: drones, missions, deliveries and alarms on one screen, until Ctrl-C."""

import time
from contextlib import suppress
from typing import Annotated

import typer
from rich.console import Console

from skyway.cli.data_folder import DataOption, data_folder
from skyway.cli.gateway import fail, read_keys
from skyway.cli.top.reader import NoAnswer, TopReader
from skyway.cli.top.screen import TopScreen

#: Wall seconds between two reads.
_EVERY_S = 1.0

_NEEDED = ("SKYWAY_GATEWAY_URL", "SKYWAY_OPERATOR_KEY")


def top_command(
    once: Annotated[bool, typer.Option("--once", help="Print it once, for scripts.")] = False,
    data: DataOption = None,
) -> None:
    """Show a running Skyway on one screen: drones, missions, deliveries, alarms, lag."""
    folder = data_folder(data)
    settings = read_keys(folder)
    for name in _NEEDED:
        if not settings.get(name):
            fail(f"{name} is not set, neither in the environment nor in {folder.keys_file}")
    url, key = (settings[name] for name in _NEEDED)
    with TopReader(url, key=key) as reader:
        try:
            reader.read()
        except NoAnswer as error:
            fail(str(error))
        if once:
            _print_once(reader)
        else:
            with suppress(KeyboardInterrupt):
                _watch(reader)


def _print_once(reader: TopReader) -> None:
    """Print the second of two reads: rates need two reads."""
    time.sleep(_EVERY_S)
    console = Console()
    console.print(TopScreen(console).shown(reader.read()))


def _watch(reader: TopReader) -> None:
    with TopScreen(Console()) as screen:
        while True:
            due_s = time.monotonic() + _EVERY_S
            try:
                screen.show(reader.read())
            except NoAnswer as error:
                screen.show_silence(str(error))
            time.sleep(max(0.0, due_s - time.monotonic()))
