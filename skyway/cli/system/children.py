"""The processes of a local Skyway: their sockets, their environment and their commands."""

import os
import socket
import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from types import MappingProxyType

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
        "SKYWAY_PROOF_STORE": os.environ.get(
            "SKYWAY_PROOF_STORE", folder.photos.resolve().as_uri()
        ),
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
