"""`skyway up`: the whole system on this machine, until Ctrl-C."""

import asyncio
from collections.abc import Callable
from typing import IO, TYPE_CHECKING, Annotated, Final, Never, cast

import typer

from skyway.cli.data_folder import DataFolder, DataOption, data_folder, keep_kernels
from skyway.errors import SkywayError

if TYPE_CHECKING:
    from rich.console import Console

    from skyway.cli.system.children import Ports
    from skyway.cli.system.running_system import System

#: Fleet seconds per second of wall time. In the small world a flight between two stations takes
#: about ten seconds, so that one sees the drones move.
_RATE: Final = 120.0

RateOption = Annotated[
    float | None,
    typer.Option(
        min=1.0,
        max=100_000.0,
        help="Fleet seconds per second of wall time.",
        show_default=f"{_RATE:g}, with --demo 60, or less on a slow machine",
    ),
]
PortOption = Annotated[
    int, typer.Option(min=0, max=65535, help="The gateway's port; 0 is any free port.")
]
MqttPortOption = Annotated[
    int, typer.Option(min=0, max=65535, help="The embedded broker's port; 0 is any free port.")
]


def up_command(
    data: DataOption = None,
    rate: RateOption = None,
    port: PortOption = 8000,
    mqtt_port: MqttPortOption = 1883,
    demo: Annotated[
        bool,
        typer.Option(
            "--demo",
            help="Keep a small world going: simulated fleets on the bundled network, and a "
            "delivery requested every few seconds.",
        ),
    ] = False,
    cells: Annotated[
        list[str] | None,
        typer.Option(
            "--cell",
            metavar="NETWORK",
            help="A network that gets a composition and a database of its own; once for each "
            "network. A data folder keeps its cells: later starts need no option.",
        ),
    ] = None,
) -> None:
    """Start all processes and keep them running until Ctrl-C."""
    from skyway.cli.system.children import Ports

    folder = data_folder(data)
    keep_kernels(folder)
    ports = Ports(gateway=port, broker=mqtt_port)
    asyncio.run(
        _up(
            folder, rate=rate or _default_rate(demo=demo), ports=ports, demo=demo, cells=cells or []
        )
    )


def _default_rate(*, demo: bool) -> float:
    from skyway.cli.system.fleet_time import machine_speed, rate_for

    return rate_for(machine_speed()) if demo else _RATE


async def _up(
    folder: DataFolder, *, rate: float, ports: "Ports", demo: bool, cells: list[str]
) -> None:
    from rich.console import Console

    from skyway.cli.system.announce import LastingOutput, asked_to_stop
    from skyway.cli.system.supervisor import first_of

    console = Console(file=cast("IO[str]", LastingOutput(folder)))
    with asked_to_stop(console) as asked:
        running = _run(console, folder, rate=rate, ports=ports, demo=demo, cells=cells)
        await first_of(asked.wait(), running)
    console.print("Skyway has stopped; nothing is left running.")


async def _run(
    console: "Console",
    folder: DataFolder,
    *,
    rate: float,
    ports: "Ports",
    demo: bool,
    cells: list[str],
) -> None:
    from skyway.cli.system.announce import announce, login_link
    from skyway.cli.system.running_system import running_system
    from skyway.cli.system.supervisor import first_of

    def say(line: str) -> None:
        console.print(line, soft_wrap=True, markup=False)

    async with running_system(folder, rate=rate, ports=ports, say=say, cells=cells) as system:
        announce(console, system, link=await login_link(system))
        small_world = keep_small_world(system, say=say, at_once=demo)
        await first_of(small_world, system.supervisor.failed())


async def keep_small_world(system: "System", *, say: Callable[[str], None], at_once: bool) -> Never:
    """Run the small world once somebody asks for it; the system goes on if it is refused."""
    folder = system.folder
    if at_once:
        folder.small_world_request.touch()
    else:
        await until_requested(folder)
    # Imported here: networks take a moment, and most starts need none.
    from skyway.cli.small_world.living import live_on

    while True:
        try:
            await live_on(system, say=say)
        except SkywayError as refusal:
            say(f"The small world does not start: {refusal}")
        await until_requested(folder)


_LOOK_EVERY_S: Final = 0.5


async def until_requested(folder: DataFolder) -> None:
    """Wait until an operator asks for the small world; requests of earlier starts do not count."""
    folder.small_world_request.unlink(missing_ok=True)
    # Another process makes the file, so no event of this one can be awaited.
    while not folder.small_world_request.exists():  # noqa: ASYNC110
        await asyncio.sleep(_LOOK_EVERY_S)
