"""Which processes make up a local Skyway, on which sockets, and what each of them is told."""

import os
import socket
import sys
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass

from skyway.cli.data_folder import CLOUD_SERVICES, DataFolder
from skyway.cli.system.supervisor import Child, listen

_HOST = "127.0.0.1"

#: The package that each process runs.
PACKAGES = {
    "registry": "skyway_provider_registry",
    "composition": "skyway_composition",
    "gateway": "skyway_gateway",
    "broker": "skyway_broker",
}


@dataclass(frozen=True, slots=True)
class Ports:
    """Where the public faces listen; 0 takes a free port. Everything else takes free ones."""

    gateway: int = 8000
    broker: int = 1883


def bind(ports: Ports, held: ExitStack) -> dict[str, socket.socket]:
    """The sockets by process, in start order: the registry writes what the broker reads."""
    wanted = {"registry": 0, "broker": ports.broker, "composition": 0, "gateway": ports.gateway}
    if named_broker() is not None:
        del wanted["broker"]
    return {
        name: held.enter_context(listen(_HOST, port, purpose=f"the {name}"))
        for name, port in wanted.items()
    }


def service_urls(sockets: Mapping[str, socket.socket]) -> dict[str, str]:
    """Where each cloud service answers."""
    return {name: f"http://{_HOST}:{_port(sockets[name])}" for name in CLOUD_SERVICES}


def environment(folder: DataFolder, sockets: Mapping[str, socket.socket]) -> dict[str, str]:
    """What every process is told; its database and its own socket come on top."""
    told = {
        "SKYWAY_SECRETS_DIR": str(folder.secrets.resolve()),
        "SKYWAY_CLOCK_FILE": str(folder.clock_file.resolve()),
        "SKYWAY_BROKER_PASSWORD_FILE": str(folder.broker_passwords.resolve()),
        "SKYWAY_WEBHOOK_ALLOW_NETWORKS": os.environ.get(
            "SKYWAY_WEBHOOK_ALLOW_NETWORKS", "127.0.0.0/8"
        ),
    }
    if folder.drone_ca.exists():
        told["SKYWAY_DRONE_CA_DIR"] = str(folder.drone_ca.resolve())
    for name, url in service_urls(sockets).items():
        told[f"SKYWAY_{name.upper()}_URL"] = url
    broker = named_broker()
    if broker is None:
        told["SKYWAY_MQTT_URL"] = f"mqtt://{_HOST}:{_port(sockets['broker'])}"
    else:
        told["SKYWAY_MQTT_URL"] = broker
        told["SKYWAY_BROKER_PID_FILE"] = str(folder.broker_pid.resolve())
    return told


def child(
    name: str,
    folder: DataFolder,
    *,
    listener: socket.socket,
    told: Mapping[str, str],
    database_urls: Mapping[str, str],
) -> Child:
    """One process to keep running."""
    own = dict(told)
    if name in database_urls:
        own["SKYWAY_DATABASE_URL"] = database_urls[name]
        own["SKYWAY_PORT"] = str(_port(listener))
    return Child(
        name=name,
        command=(sys.executable, "-m", PACKAGES[name]),
        log=folder.log(name),
        environment=own,
        listener=listener,
    )


def _port(listener: socket.socket) -> int:
    port: int = listener.getsockname()[1]
    return port


#: keys.env says with it that the broker of its `SKYWAY_MQTT_URL` runs only while the system does.
#: A shell that sourced keys.env names no other broker to the next `skyway up`.
OWN_BROKER_URL = "SKYWAY_OWN_MQTT_URL"


def named_broker() -> str | None:
    """The address of the broker that somebody else runs; None when it is ours to start."""
    url = os.environ.get("SKYWAY_MQTT_URL")
    return None if url == os.environ.get(OWN_BROKER_URL) else url
