"""A cluster of NATS on this machine: each node runs as in a container, and may be killed."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

from skyway.broker_setup.certificates import CertificateAuthority
from skyway.broker_setup.nats import NatsNode, NatsTls, nats_conf
from skyway.broker_setup.private_file import write_private

_ROOT: Final = Path(__file__).parents[4]
_SERVER: Final = Path(sys.executable).with_name("nats-server")
NODES: Final = 3


class Cluster:
    """Three nodes, which check each other's certificates, and read one file of accounts."""

    def __init__(self, folder: Path, *, accounts: Path) -> None:
        self._folder = folder
        self._accounts = accounts
        tls = _cluster_tls(folder)
        ports = _free_ports(2 * NODES)
        self._nodes = [
            NatsNode(
                f"node-{number}",
                "127.0.0.1",
                next(ports),
                next(ports),
                folder / str(number),
                cluster_tls=tls,
                cluster_password="failover",
            )
            for number in range(NODES)
        ]
        self._processes: dict[int, subprocess.Popen[bytes]] = {}

    @property
    def url(self) -> str:
        """The addresses of all nodes."""
        return ",".join(f"mqtt+nats://127.0.0.1:{node.mqtt_port}" for node in self._nodes)

    def start(self) -> None:
        """Start all nodes."""
        for number in range(NODES):
            self._start(number)

    def _start(self, number: int) -> None:
        node = self._nodes[number]
        configuration = self._folder / f"{node.name}.conf"
        routes = [f"127.0.0.1:{each.cluster_port}" for each in self._nodes]
        accounts_file = os.path.relpath(self._accounts, self._folder)
        write_private(configuration, nats_conf(node, nodes=routes, accounts_file=accounts_file))
        command = ("sh", "deploy/nats/start.sh", configuration, self._accounts, _SERVER)
        with (self._folder / f"{node.name}.log").open("ab") as log:
            self._processes[number] = subprocess.Popen(
                command, cwd=_ROOT, stdout=log, stderr=log, start_new_session=True
            )

    def kill(self, number: int) -> None:
        """End a node as a machine ends that loses its power."""
        process = self._processes[number]
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def stop(self) -> None:
        """End all nodes."""
        for number in self._processes:
            self.kill(number)


def _cluster_tls(folder: Path) -> NatsTls:
    authority = CertificateAuthority.make(folder / "ca", "Skyway nodes")
    signed = authority.sign_node(("127.0.0.1",))
    files = NatsTls(folder / "ca.pem", folder / "node.pem", folder / "node-key.pem")
    write_private(files.ca_file, authority.certificate_pem)
    write_private(files.certificate_file, signed.certificate_pem)
    write_private(files.key_file, signed.private_key_pem)
    return files


def _free_ports(count: int) -> Iterator[int]:
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return iter(ports)
