"""`skyway demo`: plays the paper's scenario on a whole system of its own."""

import asyncio
import shutil
from typing import IO, Annotated, cast

import typer

from skyway.cli.data_folder import DataFolder, DataOption, data_folder, held, keep_kernels
from skyway.errors import SkywayError

#: The delivery shall take about this long on the wall (docs/reference/time.md).
_WALL_S = 22.0


def demo_command(
    data: DataOption = None,
    stay: Annotated[
        bool, typer.Option("--stay", help="Keep the system running afterwards, until Ctrl-C.")
    ] = False,
) -> None:
    """Play the paper's scenario through real processes, and end."""
    folder = DataFolder(data_folder(data).path / "demo")
    keep_kernels(data_folder(data))
    _empty(folder)
    asyncio.run(_demo(folder, stay=stay))


def _empty(folder: DataFolder) -> None:
    """Empty the folder: a demo does not use the files of an earlier demo."""
    folder.make()
    with held(folder):
        for path in folder.path.iterdir():
            if path.is_dir():
                shutil.rmtree(path)
            elif path != folder.lock_file:
                path.unlink()


async def _demo(folder: DataFolder, *, stay: bool) -> None:
    # Imported here: all of it takes a second, and the help text does not need it.
    from rich.console import Console

    from skyway.cli.demo.scenario import play
    from skyway.cli.demo.screen import DemoScreen
    from skyway.cli.demo.world import rehearse
    from skyway.cli.system.announce import LastingOutput, announce, asked_to_stop, login_link
    from skyway.cli.system.children import Ports
    from skyway.cli.system.running_system import running_system
    from skyway.cli.system.supervisor import first_of

    console = Console(file=cast("IO[str]", LastingOutput(folder)))
    planned_s = rehearse()
    rate = planned_s / _WALL_S
    ports = Ports() if stay else Ports(gateway=0, broker=0)
    with DemoScreen(console) as screen, asked_to_stop(console) as asked:
        screen.starting(planned_s=planned_s, rate=rate)
        has_ended = asyncio.Event()

        async def run() -> None:
            starting = running_system(folder, rate=rate, ports=ports, say=console.print)
            async with starting as system:
                if stay:
                    screen.watch_at(await login_link(system))
                await first_of(play(system, screen), system.supervisor.failed())
                has_ended.set()
                if stay:
                    announce(console, system, link=await login_link(system))
                    await system.supervisor.failed()

        await first_of(asked.wait(), run())
        if not has_ended.is_set():
            raise SkywayError("stopped before the scenario ended")
