"""A broker of our own with accounts that are known before: Mosquitto, or the embedded one."""

import getpass
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from skyway_lab.benchmarks.fleet.crew import PASSWORD

from skyway.broker_setup.account_files import client_files, service_files
from skyway.broker_setup.mosquitto import mosquitto_conf
from skyway.broker_setup.passwords import hash_password, write_password_file
from skyway.broker_setup.private_file import write_private
from skyway.contracts.broker_rules import SERVICE_ACCOUNTS, BrokerRules
from skyway.errors import SkywayError

#: Where Mosquitto is installed for those who are not root.
_SERVERS: Final = "/usr/sbin"

#: How often, and with what pause in wall seconds, a broker that starts is tried.
_TRIES, _PAUSE_S = 100, 0.05


@dataclass(frozen=True, slots=True)
class OwnBroker:
    """Where drones and services meet a broker, and its process."""

    drones_url: str
    services_url: str
    pid: int


@contextmanager
def own_mosquitto(folder: Path, accounts: Iterable[str]) -> Iterator[OwnBroker]:
    """Mosquitto, as a deployment configures it."""
    program = shutil.which("mosquitto", path=f"{os.environ['PATH']}:{_SERVERS}")
    if program is None:
        raise SkywayError("Mosquitto is not installed")
    drone_port, service_port = _free_port(), _free_port()
    passwords, rules = _passwords(folder, accounts), BrokerRules()
    write_private(client_files(passwords).acl_file, rules.client_acl())
    write_private(service_files(passwords).acl_file, rules.service_acl())
    file = folder / "mosquitto.conf"
    file.write_text(
        mosquitto_conf(
            port=drone_port,
            service_port=service_port,
            password_file=passwords,
            pid_file=folder / "mosquitto.pid",
            user=getpass.getuser(),
        )
    )
    running = subprocess.Popen([program, "-c", str(file)], stderr=subprocess.DEVNULL)
    with _ended(running):
        _wait_listening(service_port)
        yield OwnBroker(_url(drone_port), _url(service_port), running.pid)


@contextmanager
def own_embedded(folder: Path, accounts: Iterable[str]) -> Iterator[OwnBroker]:
    """The embedded broker."""
    passwords = _passwords(folder, accounts)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        running = subprocess.Popen(
            [sys.executable, "-m", "skyway_broker"],
            env={
                **os.environ,
                "SKYWAY_SOCKET_FD": str(listener.fileno()),
                "SKYWAY_BROKER_PASSWORD_FILE": str(passwords),
                "SKYWAY_LOG_LEVEL": "WARNING",
            },
            pass_fds=[listener.fileno()],
        )
        url = _url(listener.getsockname()[1])
    with _ended(running):
        yield OwnBroker(url, url, running.pid)


def _passwords(folder: Path, accounts: Iterable[str]) -> Path:
    """The accounts of these and of all services; one hash for all, since hashing takes long."""
    file, hashed = folder / "passwords", hash_password(PASSWORD)
    write_password_file(file, dict.fromkeys(accounts, hashed))
    write_password_file(service_files(file).password_file, dict.fromkeys(SERVICE_ACCOUNTS, hashed))
    return file


@contextmanager
def _ended(running: "subprocess.Popen[bytes]") -> Iterator[None]:
    try:
        yield
    finally:
        running.terminate()
        running.wait(timeout=30)


def _wait_listening(port: int) -> None:
    for _ in range(_TRIES):
        with suppress(OSError), socket.create_connection(("127.0.0.1", port)):
            return
        time.sleep(_PAUSE_S)
    raise SkywayError("Mosquitto does not listen")


def _url(port: int) -> str:
    return f"mqtt://127.0.0.1:{port}"


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
