"""Two PostgreSQL servers under Patroni, with synchronous replication, and etcd beside them.

Needs Debian's packages `patroni`, `etcd-server` and `postgresql`. A node is killed as a machine
ends that loses its power: Patroni and its server together.
"""

import json
import os
import shutil
import signal
import socket
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import httpx
from skyway_lab.benchmarks.load.cpu import with_descendants
from skyway_lab.benchmarks.load.servers import Server, postgresql_program, server_user

from skyway.errors import SkywayError

_HOST: Final = "127.0.0.1"
_STARTS_WITHIN_S: Final = 120.0

#: Lines of each log that are shown when the cluster does not start.
_SHOWN_LINES: Final = 12

#: Wall seconds. A primary that does not renew its lease for `ttl` is replaced; 20 is the least that
#: Patroni takes, and `loop_wait + 2 * retry_timeout` must not be more.
_LEASE: Final = {"ttl": 20, "loop_wait": 2, "retry_timeout": 5}


@dataclass(frozen=True, slots=True)
class _Node:
    name: str
    port: int
    rest_port: int
    folder: Path
    server: Server

    def is_as(self, role: str) -> bool:
        """Whether Patroni's REST interface says that the node has this role now."""
        with suppress(httpx.HTTPError):
            url = f"http://{_HOST}:{self.rest_port}/{role}"
            return httpx.get(url, timeout=2.0).status_code == httpx.codes.OK
        return False

    def kill(self) -> None:
        """End Patroni and its PostgreSQL server, which is no child of Patroni."""
        pids = self.server.pids
        with suppress(OSError):
            postmaster = int((self.folder / "data/postmaster.pid").read_text().split()[0])
            pids += with_descendants([postmaster])
        for pid in pids:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.server.kill()


@dataclass(frozen=True, slots=True)
class Cluster:
    """A running cluster; each write is on both servers before it is confirmed."""

    nodes: tuple[_Node, _Node]

    @property
    def url(self) -> str:
        """The URL that names both servers, as `SKYWAY_DATABASE_URL` takes it."""
        return f"postgresql://skyway@{','.join(f'{_HOST}:{n.port}' for n in self.nodes)}/postgres"

    def wait_until_safe(self) -> None:
        """Wait for a primary with a synchronous standby, which may replace it without a loss."""
        _until(lambda: any(each.is_as("primary") for each in self.nodes), "no primary")
        _until(lambda: any(each.is_as("synchronous") for each in self.nodes), "no standby")

    def kill_primary(self) -> str:
        """Kill the node of the primary; its name."""
        node = next(each for each in self.nodes if each.is_as("primary"))
        node.kill()
        return node.name

    def start_again(self, name: str) -> None:
        """Start a killed node, which comes back as the other's standby."""
        next(each for each in self.nodes if each.name == name).server.start()


@contextmanager
def patroni_cluster() -> Iterator[Cluster]:
    """A new cluster for the length of the block."""
    # A socket's path may have about 100 characters, and PostgreSQL's user must reach the folder.
    folder = Path(tempfile.mkdtemp(prefix="skyway-patroni-"))
    user = server_user()
    ports = _free_ports(6)
    etcd = Server("etcd", _etcd(folder, next(ports), next(ports)), folder / "etcd.log", user=user)
    nodes = [
        _node(folder / f"node-{n}", next(ports), next(ports), etcd_port=_client_port(etcd))
        for n in (1, 2)
    ]
    if user is not None:
        # The configurations too: after a first run this process makes files only for itself.
        for each in (folder, *folder.glob("node-*"), *folder.glob("node-*/*")):
            os.chown(each, user.pw_uid, user.pw_gid)
    cluster = Cluster((nodes[0], nodes[1]))
    try:
        etcd.start()
        for node in nodes:
            node.server.start()
        try:
            cluster.wait_until_safe()
        except SkywayError as error:
            logs = "\n".join(map(_last_words, (etcd.log, *(node.server.log for node in nodes))))
            raise SkywayError(f"{error}; the last lines of the logs:\n{logs}") from error
        yield cluster
    finally:
        for node in nodes:
            node.kill()
        etcd.kill()
        shutil.rmtree(folder)


def _etcd(folder: Path, client_port: int, peer_port: int) -> list[str]:
    client, peer = f"http://{_HOST}:{client_port}", f"http://{_HOST}:{peer_port}"
    return [
        _program("etcd"),
        *("--name", "etcd", "--data-dir", str(folder / "etcd")),
        *("--listen-client-urls", client, "--advertise-client-urls", client),
        *("--listen-peer-urls", peer, "--initial-advertise-peer-urls", peer),
        *("--initial-cluster", f"etcd={peer}"),
    ]


def _client_port(etcd: Server) -> int:
    url = etcd.command[etcd.command.index("--listen-client-urls") + 1]
    return int(url.rpartition(":")[2])


def _node(folder: Path, port: int, rest_port: int, *, etcd_port: int) -> _Node:
    folder.mkdir()
    configuration = folder / "patroni.json"  # JSON is YAML
    settings = _settings(folder, port=port, rest_port=rest_port, etcd_port=etcd_port)
    configuration.write_text(json.dumps(settings))
    command = [_program("patroni"), str(configuration)]
    server = Server(folder.name, command, folder / "log", user=server_user())
    return _Node(folder.name, port, rest_port, folder, server)


def _settings(folder: Path, *, port: int, rest_port: int, etcd_port: int) -> dict[str, Any]:
    """Patroni's configuration. Any: its values are of every type."""
    address, rest = f"{_HOST}:{port}", f"{_HOST}:{rest_port}"
    account = {"username": "skyway"}
    return {
        "scope": "skyway",
        "name": folder.name,
        "restapi": {"listen": rest, "connect_address": rest},
        "etcd3": {"hosts": f"{_HOST}:{etcd_port}"},
        "bootstrap": {
            "dcs": {
                **_LEASE,
                "synchronous_mode": True,
                # Deliveries may go on where the killed server's last writes are missing, so the
                # killed server must be able to go back to what both have.
                "postgresql": {"use_pg_rewind": True, "parameters": {"max_connections": 200}},
            },
            "initdb": [{"encoding": "UTF8"}, "data-checksums"],
        },
        "postgresql": {
            "listen": address,
            "connect_address": address,
            "data_dir": str(folder / "data"),
            "bin_dir": str(postgresql_program("initdb").parent),
            "pgpass": str(folder / "pgpass"),
            "authentication": {"superuser": account, "replication": account},
            "pg_hba": [f"host all all {_HOST}/32 trust", f"host replication all {_HOST}/32 trust"],
            "parameters": {"unix_socket_directories": str(folder)},
        },
    }


def _last_words(log: Path) -> str:
    lines = log.read_text(errors="replace").splitlines()[-_SHOWN_LINES:]
    return f"{log.parent.name}/{log.name}:\n" + "\n".join(lines)


def _program(name: str) -> str:
    found = shutil.which(name)
    if found is None:
        raise SkywayError(f"there is no {name}: apt-get install patroni etcd-server postgresql")
    return found


def _free_ports(count: int) -> Iterator[int]:
    sockets = [socket.create_server((_HOST, 0)) for _ in range(count)]
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return iter(ports)


def _until(is_so: Callable[[], bool], otherwise: str) -> None:
    ends_s = time.monotonic() + _STARTS_WITHIN_S
    while not is_so():
        if time.monotonic() > ends_s:
            raise SkywayError(f"{otherwise} after {_STARTS_WITHIN_S:g} s")
        time.sleep(0.5)
