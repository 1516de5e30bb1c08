"""The processes of a local Skyway: their sockets, their environment and their commands."""

import asyncio
import os
import shutil
import socket
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

from skyway.cli.data_folder import CLOUD_SERVICES, DataFolder
from skyway.cli.system.retry import NotNow, until_done
from skyway.cli.system.supervisor import Child

_HOST = "127.0.0.1"

#: How long to wait for a port that is in use, seconds of wall time.
_PORTS_FREE_WITHIN_S = 60.0

NO_CELLS: Mapping[str, str] = MappingProxyType({})

#: The package that each process runs.
PACKAGES = {
    "registry": "skyway_provider_registry",
    "composition": "skyway_composition",
    "gateway": "skyway_gateway",
    "broker": "skyway_broker",
}

#: The services that may run as several processes on a database server.
REPLICATED = ("registry", "composition", "gateway")


@dataclass(frozen=True, slots=True)
class Ports:
    """The public ports; 0 is any free port. All others are free ports."""

    gateway: int = 8000
    broker: int = 1883


def bind(ports: Ports, held: ExitStack, cells: Iterable[str] = ()) -> dict[str, socket.socket]:
    """The sockets by process, in start order: the registry starts before the broker.

    The registry writes the accounts that the broker reads.
    """
    ports_by_name = {
        "registry": 0,
        "broker": ports.broker,
        "composition": 0,
        "gateway": ports.gateway,
        **dict.fromkeys(cells, 0),
    }
    if named_broker() is not None:
        del ports_by_name["broker"]
    return {
        name: held.enter_context(listen(_HOST, port, purpose=f"the {name}"))
        for name, port in ports_by_name.items()
    }


async def bind_when_free(
    ports: Ports, held: ExitStack, cells: Iterable[str] = (), *, say: Callable[[str], None]
) -> dict[str, socket.socket]:
    """The same, once the ports are free: the processes of a killed Skyway need a moment to leave.

    Raises
    ------
    NotNow
        A port is still in use after a minute.
    """

    async def bind_all() -> dict[str, socket.socket]:
        with ExitStack() as bound:
            sockets = bind(ports, bound, cells)
            held.push(bound.pop_all())
            return sockets

    return await until_done(bind_all, say=say, within_s=_PORTS_FREE_WITHIN_S)


def service_urls(sockets: Mapping[str, socket.socket]) -> dict[str, str]:
    """The URL of each cloud service."""
    return {name: f"http://{_HOST}:{_port(sockets[name])}" for name in CLOUD_SERVICES}


def cell_urls(cells: Mapping[str, str], sockets: Mapping[str, socket.socket]) -> dict[str, str]:
    """The URL of each cell."""
    return {name: f"http://{_HOST}:{_port(sockets[name])}" for name in cells}


def environment(
    folder: DataFolder, sockets: Mapping[str, socket.socket], cells: Mapping[str, str] = NO_CELLS
) -> dict[str, str]:
    """The settings of all processes; each process gets its database and socket in addition.

    `cells` are the networks of the cells by their names.
    """
    settings = {
        "SKYWAY_SECRETS_DIR": str(folder.secrets.resolve()),
        "SKYWAY_CLOCK_FILE": str(folder.clock_file.resolve()),
        "SKYWAY_BROKER_PASSWORD_FILE": str(folder.broker_passwords.resolve()),
        "SKYWAY_WEBHOOK_ALLOW_NETWORKS": os.environ.get(
            "SKYWAY_WEBHOOK_ALLOW_NETWORKS", "127.0.0.0/8"
        ),
        "SKYWAY_SMALL_WORLD_FILE": str(folder.small_world_request.resolve()),
    }
    if folder.drone_ca.exists():
        settings["SKYWAY_DRONE_CA_DIR"] = str(folder.drone_ca.resolve())
    for name, url in service_urls(sockets).items():
        settings[f"SKYWAY_{name.upper()}_URL"] = url
    if cells:
        own = [f"{cells[name]}={url}" for name, url in cell_urls(cells, sockets).items()]
        settings["SKYWAY_CELLS"] = ",".join([*own, os.environ.get("SKYWAY_CELLS", "")])
    broker = named_broker()
    if broker is None:
        url = f"mqtt://{_HOST}:{_port(sockets['broker'])}"
        settings |= {"SKYWAY_MQTT_URL": url, "SKYWAY_MQTT_DRONE_URL": url}
    else:
        settings["SKYWAY_MQTT_URL"] = broker
        if not is_nats():
            settings["SKYWAY_BROKER_PID_FILE"] = str(folder.broker_pid.resolve())
    return settings


def replica_name(service: str, number: int) -> str:
    """The name of a service's process; the first one is called as its service."""
    return service if number == 1 else f"{service}-{number}"


def child(
    name: str,
    folder: DataFolder,
    *,
    listener: socket.socket,
    shared: Mapping[str, str],
    database_urls: Mapping[str, str],
) -> Child:
    """One process for the supervisor to keep running; `shared` are the settings of all.

    The process of a cell is a further composition.
    """
    own = dict(shared)
    if name in database_urls:
        own["SKYWAY_DATABASE_URL"] = database_urls[name]
        own["SKYWAY_PORT"] = str(_port(listener))
    if name not in PACKAGES:
        own["SKYWAY_CELL_URL"] = f"http://{_HOST}:{_port(listener)}"
    return Child(
        name=name,
        command=(sys.executable, "-m", PACKAGES.get(name, PACKAGES["composition"])),
        log=folder.log(name),
        environment=own,
        listener=listener,
    )


def _port(listener: socket.socket) -> int:
    port: int = listener.getsockname()[1]
    return port


#: This setting in keys.env says that the broker of `SKYWAY_MQTT_URL` is the embedded broker. So a
#: shell that sourced keys.env does not name another broker to the next `skyway up`.
OWN_BROKER_URL = "SKYWAY_OWN_MQTT_URL"


def named_broker() -> str | None:
    """The URL of an external broker; None when `skyway up` starts the embedded broker."""
    url = os.environ.get("SKYWAY_MQTT_URL")
    return None if url == os.environ.get(OWN_BROKER_URL) else url


def is_nats() -> bool:
    """Whether the external broker is NATS, whose nodes watch their accounts by themselves."""
    return os.environ.get("SKYWAY_BROKER_KIND") == "nats"


def listen(host: str, port: int, *, purpose: str) -> socket.socket:
    """A listening socket to pass to a child; port 0 is any free port.

    Raises
    ------
    NotNow
        The port is in use; the message names the port and its purpose.
    """
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        raise NotNow(f"port {port} for {purpose} cannot be used: {error.strerror}") from error
    listener.listen(1024)
    return listener


#: How much nicer simulated drones are than the system, in steps of nice(1): where all want the
#: processor they get a third of the time.
SIMULATES: Final = 5

_NICEST: Final = 19
#: Linux changes the niceness of a group at most once in this many seconds, except for root.
_BETWEEN_GROUPS_S: Final = 0.1
_TRIES: Final = 20


def give_way(pid: int, *, by: int) -> None:
    """Make a new process nicer than this one; do nothing where the system has no niceness.

    This needs no privileges, and children of the process inherit it.
    """
    if not hasattr(os, "setpriority"):
        return
    niceness = min(os.getpriority(os.PRIO_PROCESS, 0) + by, _NICEST)
    with suppress(OSError):  # it may have ended, or it may be nicer already
        os.setpriority(os.PRIO_PROCESS, pid, niceness)
        if os.getsid(pid) == pid:
            _give_way_as_group(pid, niceness)


def _give_way_as_group(pid: int, niceness: int) -> None:
    """Make the process's session nicer too.

    With autogroup on, as on most desktops, Linux first shares a processor among sessions. The
    niceness of processes counts only within a session (sched(7)).
    """
    group = Path(f"/proc/{pid}/autogroup")
    for _ in range(_TRIES if group.exists() else 0):
        try:
            group.write_text(str(niceness))
        except BlockingIOError:
            time.sleep(_BETWEEN_GROUPS_S)
        else:
            return


#: A log above this size is set aside, bytes.
LOG_BYTES: Final = 20 << 20
#: How many logs of a process are kept beside the present one: `gateway.log.1` is the newest.
KEPT: Final = 4
#: Seconds of wall time between two looks.
_EVERY_S: Final = 30.0


def rotate(log: Path, *, most_bytes: int = LOG_BYTES) -> bool:
    """Set a log aside if it is larger; True if it was.

    The process goes on writing into the same file, which it appends to. Lines that it writes
    between the copy and the cut are lost.
    """
    if log.stat().st_size <= most_bytes:
        return False
    for number in range(KEPT, 1, -1):
        older = _aside(log, number - 1)
        if older.exists():
            older.replace(_aside(log, number))
    shutil.copy2(log, _aside(log, 1))
    os.truncate(log, 0)
    return True


async def keep_logs_small(folder: DataFolder) -> None:
    """Look at all logs from time to time, until cancelled."""
    while True:
        for log in folder.logs.glob("*.log"):
            await asyncio.to_thread(rotate, log)
        await asyncio.sleep(_EVERY_S)


def _aside(log: Path, number: int) -> Path:
    return log.with_name(f"{log.name}.{number}")
