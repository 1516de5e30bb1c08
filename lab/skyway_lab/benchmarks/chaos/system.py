"""A whole Skyway for a run: replicas, their pair of storage, a wire between each two parts."""

import asyncio
import os
import tempfile
from collections.abc import AsyncIterator, Mapping
from contextlib import AsyncExitStack, ExitStack, asynccontextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from socket import socket
from typing import Final
from urllib.parse import parse_qs, urlsplit

from skyway_lab.benchmarks.chaos.processes import KeptProcesses, Processes
from skyway_lab.benchmarks.chaos.trial import Trial
from skyway_lab.benchmarks.chaos.wire import Endpoint, Wire
from skyway_lab.benchmarks.load.servers import Server

from skyway.cli.data_folder import CLOUD_SERVICES, DataFolder, held
from skyway.cli.system.children import Ports, bind, child, environment, service_urls
from skyway.cli.system.databases import database_urls
from skyway.cli.system.fleet_time import anchor_clock, keep_heartbeat
from skyway.cli.system.readiness import until_ready
from skyway.cli.system.running_system import System
from skyway.cli.system.secrets import make_secrets, write_keys_file
from skyway.cli.system.supervisor import first_of

_HOST: Final = "127.0.0.1"
_READY_WITHIN_S: Final = 180.0
#: The name that PostgreSQL gives its socket.
_POSTGRESQL_SOCKET: Final = ".s.PGSQL.5432"
#: Which service calls which.
_CALLS: Final = {
    "gateway": ("registry", "composition"),
    "composition": ("gateway", "registry"),
    "registry": ("composition",),
}


@dataclass(frozen=True, slots=True)
class ChaosSystem:
    """A running system, its processes and its wires by name."""

    system: System
    processes: Processes
    wires: Mapping[str, Wire]
    #: Where customers reach the gateway, through their wire.
    customers_url: str


@asynccontextmanager
async def chaos_system(
    trial: Trial, folder: DataFolder, servers: Mapping[str, Server], *, webhooks: Endpoint
) -> AsyncIterator[ChaosSystem]:
    """Start everything, wait until it is ready, and end everything on leaving."""
    os.umask(0o077)
    make_secrets(folder)
    children = KeptProcesses()
    async with AsyncExitStack() as opened:
        held_here = opened.enter_context(ExitStack())
        held_here.enter_context(held(folder))
        anchor_clock(folder, rate=trial.clock_rate)
        sockets = bind(Ports(gateway=0, broker=0), held_here)
        databases = await database_urls(folder)
        shared = environment(folder, sockets)
        wires = await _opened_wires(opened, sockets, shared, databases, webhooks)
        system = System(
            folder=folder,
            supervisor=children,
            urls=service_urls(sockets),
            mqtt_url=f"mqtt://{_HOST}:{wires['drones to broker'].port}",
        )
        write_keys_file(folder, system.urls["gateway"], system.mqtt_url)
        heartbeat = asyncio.create_task(keep_heartbeat(folder))
        opened.push_async_callback(_cancelled, heartbeat)
        await opened.enter_async_context(children)
        for name, listener in sockets.items():
            process = child(
                name,
                folder,
                listener=listener,
                shared=shared | _wired_settings(name, wires),
                database_urls=_wired_databases(databases, wires),
            )
            for number in range(1, _replicas(name, trial) + 1):
                its_name = name if _replicas(name, trial) == 1 else f"{name} {number}"
                children.start(replace(process, name=its_name, log=folder.log(its_name)))
        async with asyncio.timeout(_READY_WITHIN_S):
            await first_of(until_ready(system.urls, say=print), children.failed())
        processes = Processes(children, servers)
        try:
            yield ChaosSystem(
                system,
                processes,
                wires,
                customers_url=f"http://{_HOST}:{wires['customers to gateway'].port}",
            )
        finally:
            processes.thaw(processes.pids("everything"))


def _replicas(name: str, trial: Trial) -> int:
    return trial.replicas if name in ("gateway", "composition") else 1


async def _cancelled(task: "asyncio.Task[None]") -> None:
    task.cancel()
    with suppress(asyncio.CancelledError):
        await task


async def _opened_wires(
    opened: AsyncExitStack,
    sockets: Mapping[str, socket],
    shared: Mapping[str, str],
    databases: Mapping[str, str],
    webhooks: Endpoint,
) -> dict[str, Wire]:
    """A wire for each connection between two parts, by name."""
    broker = _endpoint(shared["SKYWAY_MQTT_URL"])
    drones = _endpoint(os.environ.get("SKYWAY_MQTT_DRONE_URL", shared["SKYWAY_MQTT_URL"]))
    targets: dict[str, Endpoint] = {
        f"{caller} to {called}": (_HOST, sockets[called].getsockname()[1])
        for caller, all_called in _CALLS.items()
        for called in all_called
    }
    targets |= {f"{service} to broker": broker for service in CLOUD_SERVICES}
    targets |= {
        "drones to broker": drones,
        "customers to gateway": (_HOST, sockets["gateway"].getsockname()[1]),
        "gateway to webhooks": webhooks,
    }
    wires = [Wire(name, target) for name, target in targets.items()]
    for service, url in databases.items():
        if (server := _socket_folder(url)) is not None:
            # A socket's path may have about 100 characters.
            own = Path(opened.enter_context(tempfile.TemporaryDirectory(prefix="skyway-wire-")))
            wires.append(
                Wire(
                    f"{service} to database",
                    server / _POSTGRESQL_SOCKET,
                    listens_at=own / _POSTGRESQL_SOCKET,
                )
            )
    return {wire.name: await opened.enter_async_context(wire) for wire in wires}


def _wired_settings(service: str, wires: Mapping[str, Wire]) -> dict[str, str]:
    """The settings that lead a process over its own wires."""
    settings = {
        f"SKYWAY_{called.upper()}_URL": f"http://{_HOST}:{wires[f'{service} to {called}'].port}"
        for called in _CALLS.get(service, ())
    }
    if service in CLOUD_SERVICES:
        settings["SKYWAY_MQTT_URL"] = f"mqtt://{_HOST}:{wires[f'{service} to broker'].port}"
    return settings


def _wired_databases(urls: Mapping[str, str], wires: Mapping[str, Wire]) -> dict[str, str]:
    """The databases' URLs through their wires; SQLite files have none."""
    wired = dict(urls)
    for service, url in urls.items():
        wire = wires.get(f"{service} to database")
        if wire is not None and wire.folder is not None:
            wired[service] = f"{url.partition('?')[0]}?host={wire.folder}"
    return wired


def _endpoint(url: str) -> Endpoint:
    parts = urlsplit(url)
    return (parts.hostname or _HOST, parts.port or 1883)


def _socket_folder(url: str) -> Path | None:
    """The folder of PostgreSQL's socket in a database's URL; None for SQLite."""
    hosts = parse_qs(urlsplit(url).query).get("host")
    return Path(hosts[0]) if hosts else None
