"""`skyway up`: the whole system on this machine, until Ctrl-C."""

import asyncio
import signal
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from skyway.cli.children import Ports
from skyway.cli.data_folder import DataFolder, data_folder
from skyway.cli.system import System, running_system

DataOption = Annotated[
    Path | None, typer.Option("--data", help="Data folder; else SKYWAY_DATA, else .skyway.")
]
RateOption = Annotated[
    float, typer.Option(min=1.0, max=100_000.0, help="Fleet seconds per wall second.")
]
PortOption = Annotated[int, typer.Option(min=0, max=65535, help="The gateway's; 0: any free one.")]
MqttPortOption = Annotated[
    int, typer.Option(min=0, max=65535, help="The embedded broker's; 0: any free one.")
]


def up_command(
    data: DataOption = None,
    rate: RateOption = 120.0,
    port: PortOption = 8000,
    mqtt_port: MqttPortOption = 1883,
) -> None:
    """Start all processes and keep them running until Ctrl-C."""
    folder = data_folder(data)
    asyncio.run(_up(folder, rate=rate, ports=Ports(gateway=port, broker=mqtt_port)))


async def _up(folder: DataFolder, *, rate: float, ports: Ports) -> None:
    console = Console()
    asked_to_stop = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, asked_to_stop.set)
    async with running_system(folder, rate=rate, ports=ports) as system:
        announce(console, system)
        await until_asked_to_stop(system, asked_to_stop)
    console.print("Skyway has stopped; nothing is left running.")


def announce(console: Console, system: System) -> None:
    """Say where the system answers and how to greet it."""
    console.print(
        f"Skyway is up: [bold]{system.urls['gateway']}[/] (its pages: /docs), "
        f"broker {system.mqtt_url}\n"
        f"Keys: source {system.folder.keys_file}    Logs: {system.folder.logs}    Stop: Ctrl-C"
    )


async def until_asked_to_stop(system: System, asked: asyncio.Event) -> None:
    """Wait for the signal, or raise when a child keeps dying."""
    failure = asyncio.create_task(system.supervisor.failed())
    stop = asyncio.create_task(asked.wait())
    done, pending = await asyncio.wait({failure, stop}, return_when=asyncio.FIRST_COMPLETED)
    for task in pending:
        task.cancel()
    for task in done:
        task.result()
