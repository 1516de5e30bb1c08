"""`python -m skyway_drone_agent --fleet FILE [--journal DIR] [--mqtt-url URL] ...`."""

import asyncio
import contextlib
import os
import signal
import sys

from skyway.errors import SkywayError
from skyway.runtime.logs import configure_logs
from skyway_drone_agent.enrolled_drone import EnrolledDrone, read_fleet
from skyway_drone_agent.fleet import allow_open_files, host_fleet
from skyway_drone_agent.journal_folder import JournalFolder
from skyway_drone_agent.settings import AgentSettings, read_settings


def main() -> int:
    """Serve until told to stop; 2 when the settings or the fleet file are wrong."""
    try:
        settings = read_settings(sys.argv[1:], os.environ)
        configure_logs("drone_agent", settings.log_level)
        drones = read_fleet(settings.fleet)
        allow_open_files(len(drones))
        with JournalFolder(settings.journal, (drone.drone_id for drone in drones)) as folder:
            asyncio.run(_serve(drones, folder, settings))
    except (SkywayError, OSError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


async def _serve(
    drones: tuple[EnrolledDrone, ...], folder: JournalFolder, settings: AgentSettings
) -> None:
    hosting = host_fleet(
        drones, folder, mqtt_url=settings.mqtt_url, disturbances=settings.disturbances
    )
    serving = asyncio.create_task(hosting)
    loop = asyncio.get_running_loop()
    for stop in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(stop, serving.cancel)
    if settings.parent_fd is not None:
        # Nobody writes on the parent's pipe: it becomes readable only when the parent is gone.
        loop.add_reader(settings.parent_fd, _leave, serving, settings.parent_fd)
    with contextlib.suppress(asyncio.CancelledError):
        await serving


def _leave(serving: asyncio.Task[None], parent_fd: int) -> None:
    # Once only: a closed pipe stays readable, and the farewell must not be cancelled too.
    asyncio.get_running_loop().remove_reader(parent_fd)
    serving.cancel()


if __name__ == "__main__":
    raise SystemExit(main())
