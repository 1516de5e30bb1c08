"""Runs one local Skyway: starts all its processes, and ends all of them."""

import asyncio
import os
import sys
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import ExitStack, asynccontextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from skyway.cli.data_folder import DataFolder, held, note_ready
from skyway.cli.system.broker_files import write_mosquitto_files
from skyway.cli.system.cells import cells_of, keep_cells
from skyway.cli.system.children import (
    REPLICATED,
    Ports,
    bind_when_free,
    cell_urls,
    child,
    environment,
    is_nats,
    replica_name,
    service_urls,
)
from skyway.cli.system.databases import database_urls
from skyway.cli.system.fleet_time import anchor_clock, keep_heartbeat
from skyway.cli.system.log_rotation import keep_logs_small
from skyway.cli.system.readiness import until_ready
from skyway.cli.system.retry import until_done
from skyway.cli.system.secrets import make_secrets, write_keys_file
from skyway.cli.system.supervisor import Child, Supervisor, first_of


@dataclass(frozen=True, slots=True)
class System:
    """A running local system; drones and customers connect to the broker at `mqtt_url`."""

    folder: DataFolder
    supervisor: Supervisor
    urls: Mapping[str, str]
    mqtt_url: str
    #: The network of each cell, by the name of its process.
    cells: Mapping[str, str] = field(default_factory=dict)

    def start_fleet(self, name: str, fleet_file: Path, *, gives_way_by: int = 0) -> None:
        """Keep an agent process running that flies the drones of this file."""
        self.supervisor.start(
            Child(
                name=name,
                command=(sys.executable, "-m", "skyway_drone_agent", "--fleet", str(fleet_file)),
                log=self.folder.log(name),
                environment={
                    "SKYWAY_MQTT_URL": self.mqtt_url,
                    "SKYWAY_AGENT_JOURNAL": str(self.folder.journals.resolve()),
                },
                gives_way_by=gives_way_by,
            )
        )


@asynccontextmanager
async def running_system(
    folder: DataFolder,
    *,
    rate: float,
    ports: Ports,
    say: Callable[[str], None],
    replicas: int = 1,
    cells: Sequence[str] = (),
) -> AsyncIterator[System]:
    """Start everything, wait until it is ready, and end everything on leaving.

    `SKYWAY_DATABASE_URL` and `SKYWAY_MQTT_URL` replace the embedded database and broker. When the
    start takes long, or a process has to be started again, `say` gets the reason. Gateway and
    composition may have several `replicas`, which share their socket; this needs PostgreSQL. Each
    network of `cells` has a composition and a database of its own.

    Raises
    ------
    SkywayError
        A process cannot run for a cause that cannot pass; the message names it and its log.
    """
    # Even in a folder that others may enter, only this user can read databases and logs.
    os.umask(0o077)
    make_secrets(folder)
    with ExitStack() as opened:
        opened.enter_context(held(folder))
        anchor_clock(folder, rate=rate)
        own_cells = cells_of(folder, cells)
        sockets = await bind_when_free(ports, opened, own_cells, say=say)
        settings = environment(folder, sockets, own_cells)
        if "broker" not in sockets and not is_nats():
            write_mosquitto_files(folder)
        databases = await until_done(lambda: database_urls(folder, [*own_cells]), say=say)
        system = System(
            folder=folder,
            supervisor=Supervisor(say=say),
            urls=service_urls(sockets),
            mqtt_url=os.environ.get("SKYWAY_MQTT_DRONE_URL", settings["SKYWAY_MQTT_URL"]),
            cells=own_cells,
        )
        own_broker_url = settings["SKYWAY_MQTT_URL"] if "broker" in sockets else ""
        write_keys_file(
            folder, system.urls["gateway"], system.mqtt_url, own_broker_url=own_broker_url
        )
        keepers = [asyncio.create_task(keep(folder)) for keep in (keep_heartbeat, keep_logs_small)]
        try:
            async with system.supervisor:
                for name, listener in sockets.items():
                    process = child(
                        name, folder, listener=listener, shared=settings, database_urls=databases
                    )
                    for number in range(1, 1 + (replicas if name in REPLICATED else 1)):
                        its_name = replica_name(name, number)
                        system.supervisor.start(
                            replace(process, name=its_name, log=folder.log(its_name))
                        )
                # Each service says for as long as it takes what it waits for.
                servers = {**system.urls, **cell_urls(own_cells, sockets)}
                await first_of(until_ready(servers, say=say), system.supervisor.failed())
                note_ready(folder)
                keep_cells(folder, own_cells)
                yield system
        finally:
            for keeper in keepers:
                keeper.cancel()
                with suppress(asyncio.CancelledError):
                    await keeper
