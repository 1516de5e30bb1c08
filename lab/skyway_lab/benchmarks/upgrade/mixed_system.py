"""A local system whose services run in one version, in the other, or in both."""

import asyncio
import os
import sys
from collections.abc import AsyncIterator, Mapping
from contextlib import ExitStack, asynccontextmanager, suppress
from dataclasses import replace
from pathlib import Path
from socket import socket
from typing import Final

from skyway_lab.benchmarks.upgrade.versions import Version

from skyway.cli.data_folder import CLOUD_SERVICES, DataFolder, held
from skyway.cli.system.children import PACKAGES, Ports, bind, child, environment, service_urls
from skyway.cli.system.databases import database_urls
from skyway.cli.system.fleet_time import anchor_clock, keep_heartbeat
from skyway.cli.system.readiness import until_ready
from skyway.cli.system.running_system import System
from skyway.cli.system.secrets import make_secrets, write_keys_file
from skyway.cli.system.supervisor import Child, Supervisor, first_of
from skyway.errors import SkywayError

_READY_WITHIN_S: Final = 120.0
#: A process logs this when it accepts connections.
_STARTED: Final = "Application startup complete."


class MixedSystem:
    """Services whose processes share a socket, those of both versions too."""

    def __init__(
        self,
        system: System,
        sockets: Mapping[str, socket],
        shared: Mapping[str, str],
        databases: Mapping[str, str],
    ) -> None:
        self.system = system
        self._sockets = sockets
        self._shared = shared
        self._databases = databases

    async def migrate(self, version: Version) -> None:
        """Migrate the databases to this version while the services go on."""
        for service in CLOUD_SERVICES:
            made = self._child(service, version)
            with made.log.open("ab") as log:
                process = await asyncio.create_subprocess_exec(
                    *made.command,
                    "migrate",
                    stdout=log,
                    stderr=log,
                    env={**os.environ, **made.environment},
                )
                if await process.wait() != 0:
                    raise SkywayError(f"{service} was not migrated: {made.log.read_text()[-2000:]}")

    async def start(self, version: Version) -> None:
        """Start a process of each service in this version; they share the work from now on."""
        for service in CLOUD_SERVICES:
            its_child = self._child(service, version)
            self.system.supervisor.start(its_child)
            await first_of(_until_started(its_child.log), self.system.supervisor.failed())
        await until_ready(self.system.urls, say=print)

    async def stop(self, version: Version) -> None:
        """End the processes of this version, one service after another."""
        for service in CLOUD_SERVICES:
            await self.system.supervisor.stop(_name(service, version))

    def _child(self, service: str, version: Version) -> Child:
        made = child(
            service,
            self.system.folder,
            listener=self._sockets[service],
            shared=self._shared,
            database_urls=self._databases,
        )
        name = _name(service, version)
        log = self.system.folder.log(name)
        log.unlink(missing_ok=True)
        command = (sys.executable, "-m", PACKAGES[service])
        own = {**made.environment, **version.settings}
        return replace(made, name=name, command=command, log=log, environment=own)


@asynccontextmanager
async def mixed_system(folder: DataFolder, *, rate: float) -> AsyncIterator[MixedSystem]:
    """The clock, the secrets and the sockets of a system; no service runs yet."""
    os.umask(0o077)
    make_secrets(folder)
    with ExitStack() as opened:
        opened.enter_context(held(folder))
        anchor_clock(folder, rate=rate)
        sockets = bind(Ports(gateway=0, broker=0), opened)
        shared = environment(folder, sockets)
        databases = await database_urls(folder)
        system = System(
            folder=folder,
            supervisor=Supervisor(say=print),
            urls=service_urls(sockets),
            mqtt_url=os.environ["SKYWAY_MQTT_DRONE_URL"],
        )
        write_keys_file(folder, system.urls["gateway"], system.mqtt_url)
        heartbeat = asyncio.create_task(keep_heartbeat(folder))
        try:
            async with system.supervisor:
                yield MixedSystem(system, sockets, shared, databases)
        finally:
            heartbeat.cancel()
            with suppress(asyncio.CancelledError):
                await heartbeat


def _name(service: str, version: Version) -> str:
    return f"{service}-{version.name}"


async def _until_started(log: Path) -> None:
    async with asyncio.timeout(_READY_WITHIN_S):
        while not _has_started(log):  # noqa: ASYNC110
            await asyncio.sleep(0.1)  # another process writes it: there is nothing to wait on


def _has_started(log: Path) -> bool:
    return log.exists() and _STARTED in log.read_text()
