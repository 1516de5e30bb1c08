"""Servers of our own: a PostgreSQL and a Mosquitto that can be killed and started again."""

import os
import pwd
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from skyway_lab.benchmarks.load.cpu import with_descendants

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

#: Wall seconds within which a server must end when it is asked to.
_ENDS_WITHIN_S = 60.0

#: Wall seconds after which it is asked again: Mosquitto loses a signal that comes while it starts.
_ASKED_AGAIN_AFTER_S = 1.0


@dataclass(slots=True)
class Server:
    """A server's program; `stop_signal` ends it in order."""

    name: str
    command: Sequence[str]
    log: Path
    stop_signal: signal.Signals = signal.SIGTERM
    #: Who runs it; None for this process's own user.
    user: pwd.struct_passwd | None = None
    _process: "subprocess.Popen[bytes] | None" = None

    @property
    def pid(self) -> int:
        """The id of the server's first process."""
        if self._process is None:
            raise RuntimeError(f"{self.name} is not started")
        return self._process.pid

    @property
    def pids(self) -> list[int]:
        """The ids of all its processes; none after it has ended."""
        if self._process is None or self._process.poll() is not None:
            return []
        return list(with_descendants([self._process.pid]))

    def start(self) -> None:
        """Start it; it may take a moment until it accepts connections."""
        self._process = run_as(self.user, self.command, self.log)

    def kill(self) -> None:
        """Kill all its processes with SIGKILL."""
        for pid in self.pids:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        if self._process is not None:
            self._process.wait(timeout=_ENDS_WITHIN_S)

    def stop(self) -> None:
        """End it in order; it is asked again until it has ended."""
        if self._process is None:
            return
        last_s = time.monotonic() + _ENDS_WITHIN_S
        while self._process.poll() is None:
            if time.monotonic() > last_s:
                raise SkywayError(f"{self.name} has not ended within {_ENDS_WITHIN_S:.0f} s")
            self._process.send_signal(self.stop_signal)
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(timeout=_ASKED_AGAIN_AFTER_S)


def run_as(
    user: pwd.struct_passwd | None, command: Sequence[str], log: Path
) -> "subprocess.Popen[bytes]":
    """Start a server's program as this user: PostgreSQL does not run as root."""
    with log.open("ab") as output:
        return subprocess.Popen(
            command,
            cwd=log.parent,
            stdout=output,
            stderr=output,
            start_new_session=True,
            user=None if user is None else user.pw_uid,
            group=None if user is None else user.pw_gid,
            extra_groups=None if user is None else [],
        )


def make_postgresql(folder: Path, *, options: Sequence[str] = ()) -> Server:
    """A new cluster in this empty folder, started, and reached through a socket there."""
    binaries = postgresql_program("initdb").parent
    user, log, data = server_user(), folder / "log", folder / "data"
    if user is not None:
        os.chown(folder, user.pw_uid, user.pw_gid)
    made = run_as(user, [str(binaries / "initdb"), "-D", str(data), *_INITDB], log)
    if made.wait() != 0:
        raise SkywayError(f"initdb failed: {log.read_text()}")
    own = [option.format(folder=folder) for option in _POSTGRESQL]
    command = [str(binaries / "postgres"), "-D", str(data), *own, *options]
    # SIGINT is a fast shutdown: sessions are ended.
    server = Server("postgresql", command, log, stop_signal=signal.SIGINT, user=user)
    server.start()
    try:
        _until_accepting(binaries / "pg_isready", folder)
    except BaseException:
        server.kill()
        raise
    return server


def postgresql_url(socket_folder: Path) -> str:
    """The URL of the server's first database through the socket in this folder."""
    return f"postgresql://skyway@/postgres?host={socket_folder}"


def _until_accepting(pg_isready: Path, folder: Path) -> None:
    command = [str(pg_isready), "-h", str(folder)]
    for _ in range(150):
        if subprocess.run(command, stdout=subprocess.DEVNULL, check=False).returncode == 0:
            return
        time.sleep(0.2)
    raise SkywayError("PostgreSQL does not accept connections")


def postgresql_program(name: str) -> Path:
    """Where this program of PostgreSQL is."""
    folders = sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    path = os.pathsep.join([os.environ["PATH"], *map(str, folders)])
    found = shutil.which(name, path=path)
    if found is None:
        raise SkywayError(f"PostgreSQL is not installed: there is no {name}")
    return Path(found).resolve()


def server_user() -> pwd.struct_passwd | None:
    """Who runs what refuses to run as root; None when this process does not run as root."""
    if os.geteuid() != 0:
        return None
    known = {user.pw_name: user for user in pwd.getpwall()}
    return known.get("postgres") or known["nobody"]


def make_mosquitto(folder: DataFolder) -> Server:
    """A Mosquitto that reads this folder's files, started; sets `SKYWAY_MQTT_...` to its ports."""
    program = shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin")
    if program is None:
        raise SkywayError("Mosquitto is not installed")
    for name in ("SKYWAY_MQTT_URL", "SKYWAY_MQTT_DRONE_URL"):
        os.environ[name] = f"mqtt://127.0.0.1:{_free_port()}"
    make_secrets(folder)
    write_mosquitto_files(folder)
    command = [program, "-c", str((folder.broker / "mosquitto.conf").resolve())]
    server = Server("mosquitto", command, folder.log("mosquitto"))
    server.start()
    return server


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
