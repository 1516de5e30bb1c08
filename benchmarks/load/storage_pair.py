"""The two pairs of database and broker: the embedded one, and servers of our own for the run."""

import os
import pwd
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from benchmarks.load.burst import Storage
from skyway.cli.data_folder import DataFolder
from skyway.cli.system.broker_files import write_mosquitto_files
from skyway.cli.system.secrets import make_secrets
from skyway.errors import SkywayError

_INITDB = ("-U", "skyway", "-A", "trust", "-E", "UTF8")

#: Else as PostgreSQL is delivered, commits synced to disk; connections for the services' pools.
_POSTGRESQL = (
    "-clisten_addresses=",
    "-cunix_socket_directories={folder}",
    "-cmax_connections=200",
)

#: What a shell around the benchmark may have set for another system.
_SETTINGS = ("SKYWAY_DATABASE_URL", "SKYWAY_MQTT_URL", "SKYWAY_MQTT_DRONE_URL")


@contextmanager
def storage_pair(
    storage: Storage, folder: DataFolder, *, postgresql_options: Sequence[str] = ()
) -> Iterator[dict[str, int]]:
    """Start the servers of this pair and set the environment for it; their process ids by name."""
    with ExitStack() as stack:
        stack.enter_context(_environment_kept())
        for name in _SETTINGS:
            os.environ.pop(name, None)
        pids: dict[str, int] = {}
        if storage == "production":
            pids["postgresql"] = stack.enter_context(_postgresql(postgresql_options))
            pids["mosquitto"] = stack.enter_context(_mosquitto(folder))
        yield pids


@contextmanager
def _environment_kept() -> Iterator[None]:
    before = {name: os.environ.get(name) for name in _SETTINGS}
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def _postgresql(more_options: Sequence[str]) -> Iterator[int]:
    """A cluster in a folder of its own, reached through a socket there; its postmaster's id."""
    binaries = _postgresql_program("initdb").parent
    # A socket's path may have about 100 characters.
    folder = Path(tempfile.mkdtemp(prefix="skyway-load-"))
    user = _server_user()
    if user is not None:
        os.chown(folder, user.pw_uid, user.pw_gid)
    data = folder / "data"
    try:
        made = _as_user(user, [binaries / "initdb", "-D", data, *_INITDB], folder)
        if made.wait() != 0:
            raise SkywayError(f"initdb failed: {(folder / 'log').read_text()}")
        options = [option.format(folder=folder) for option in _POSTGRESQL]
        server = _as_user(
            user, [binaries / "postgres", "-D", data, *options, *more_options], folder
        )
        try:
            _until_accepting(binaries / "pg_isready", folder)
            os.environ["SKYWAY_DATABASE_URL"] = f"postgresql://skyway@/postgres?host={folder}"
            yield server.pid
        finally:
            server.send_signal(signal.SIGINT)  # a fast shutdown: nobody is waited for
            server.wait(timeout=60)
    finally:
        shutil.rmtree(folder)


def _as_user(
    user: pwd.struct_passwd | None, command: Sequence[str | Path], folder: Path
) -> "subprocess.Popen[bytes]":
    """Start a server's program, which does not run as root."""
    with (folder / "log").open("ab") as log:
        return subprocess.Popen(
            command,
            cwd=folder,
            stdout=log,
            stderr=log,
            start_new_session=True,
            user=None if user is None else user.pw_uid,
            group=None if user is None else user.pw_gid,
            extra_groups=None if user is None else [],
        )


def _until_accepting(pg_isready: Path, folder: Path) -> None:
    command = [str(pg_isready), "-h", str(folder)]
    for _ in range(150):
        if subprocess.run(command, stdout=subprocess.DEVNULL, check=False).returncode == 0:
            return
        time.sleep(0.2)
    raise SkywayError("PostgreSQL does not accept connections")


def _postgresql_program(name: str) -> Path:
    folders = sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    path = os.pathsep.join([os.environ["PATH"], *map(str, folders)])
    found = shutil.which(name, path=path)
    if found is None:
        raise SkywayError(f"PostgreSQL is not installed: there is no {name}")
    return Path(found).resolve()


def _server_user() -> pwd.struct_passwd | None:
    if os.geteuid() != 0:
        return None
    known = {user.pw_name: user for user in pwd.getpwall()}
    return known.get("postgres") or known["nobody"]


@contextmanager
def _mosquitto(folder: DataFolder) -> Iterator[int]:
    """A Mosquitto that reads this folder's files; its process id."""
    program = shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin")
    if program is None:
        raise SkywayError("Mosquitto is not installed")
    for name in ("SKYWAY_MQTT_URL", "SKYWAY_MQTT_DRONE_URL"):
        os.environ[name] = f"mqtt://127.0.0.1:{_free_port()}"
    make_secrets(folder)
    write_mosquitto_files(folder)
    server = subprocess.Popen(
        [program, "-c", str(folder.broker / "mosquitto.conf")],
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield server.pid
    finally:
        server.terminate()
        server.wait(timeout=30)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
