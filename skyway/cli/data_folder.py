"""The data folder of a local system: its files and folders, and its lock."""

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Annotated, Final
from urllib.parse import quote

import typer

from skyway.errors import SkywayError

#: The option of every command that reads or writes the data folder.
DataOption = Annotated[
    Path | None,
    typer.Option("--data", help="The data folder; else SKYWAY_DATA names it, else .skyway."),
]

#: The services that keep a database and hold a service credential.
CLOUD_SERVICES = ("registry", "composition", "gateway")


@dataclass(frozen=True, slots=True)
class DataFolder:
    """The data folder of `skyway up`, and the path of each file in it."""

    path: Path

    @property
    def secrets(self) -> Path:
        """One small file per secret, as Docker and Kubernetes mount them."""
        return self.path / "secrets"

    @property
    def keys_file(self) -> Path:
        """The keys and addresses for the command line, and for a shell to source."""
        return self.path / "keys.env"

    @property
    def clock_file(self) -> Path:
        """The fleet clock's anchor."""
        return self.path / "clock.json"

    @property
    def heartbeat_file(self) -> Path:
        """The last fleet time that was reached."""
        return self.path / "heartbeat.json"

    @property
    def logs(self) -> Path:
        """One log per process."""
        return self.path / "logs"

    def log(self, process: str) -> Path:
        """The log of one process."""
        return self.logs / f"{process}.log"

    @property
    def broker(self) -> Path:
        """The broker's files: passwords, access rules, and Mosquitto's configuration."""
        return self.path / "broker"

    @property
    def broker_passwords(self) -> Path:
        """The broker's accounts; only the registry writes them."""
        return self.broker / "passwords"

    @property
    def broker_pid(self) -> Path:
        """The file with Mosquitto's process id; the registry needs it to make Mosquitto reload."""
        return self.broker / "mosquitto.pid"

    @property
    def drone_ca(self) -> Path:
        """The authority that signs drones' certificates, if there is one."""
        return self.path / "drone-ca"

    @property
    def node_ca(self) -> Path:
        """The authority that signs the nodes of a cluster of NATS, and nothing else."""
        return self.path / "node-ca"

    @property
    def journals(self) -> Path:
        """The simulated drones' journals."""
        return self.path / "journals"

    @property
    def cells_file(self) -> Path:
        """The networks of the cells, if the system has any."""
        return self.path / "cells.json"

    @property
    def photos(self) -> Path:
        """The photos of hand-overs."""
        return self.path / "photos"

    @property
    def small_world_request(self) -> Path:
        """An empty file by which the gateway asks for the small world."""
        return self.path / "small-world.requested"

    @property
    def lock_file(self) -> Path:
        """The lock of the supervisor that runs on this folder."""
        return self.path / "lock"

    def database_url(self, service: str) -> str:
        """The URL of the SQLite database of a service; its path may hold `%`, `?` and `#`."""
        return f"sqlite:///{quote(str(self.database_file(service)))}"

    def database_file(self, service: str) -> Path:
        """The SQLite database of a service."""
        return (self.path / f"{service}.db").resolve()

    def make(self) -> None:
        """Make the missing folders; other users cannot read them."""
        for folder in (self.path, self.secrets, self.logs, self.broker, self.journals):
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            if not os.access(folder, os.W_OK | os.X_OK):
                raise SkywayError(f"{folder}: this user cannot write into the folder")


#: Where compiled kernels are kept, if it can be written to: the installation.
_INSTALLED: Final = Path(__file__).parents[1] / "planner/kernels/__pycache__"


def keep_kernels(folder: DataFolder, *, installed: Path = _INSTALLED) -> None:
    """Have this process and its children compile into the data folder where they could not else."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache")
    usual = (installed, home / "numba")
    if "NUMBA_CACHE_DIR" not in os.environ and not any(map(_can_be_written, usual)):
        os.environ["NUMBA_CACHE_DIR"] = str(folder.path.resolve() / "kernels")
        typer.echo(
            f"The planner is compiled into {os.environ['NUMBA_CACHE_DIR']}, because neither the "
            "installation nor your home can be written to. NUMBA_CACHE_DIR names another folder.",
            err=True,
        )


def _can_be_written(folder: Path) -> bool:
    try:
        folder.expanduser().mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=folder.expanduser()).close()
    except (OSError, RuntimeError):  # RuntimeError: this user has no home
        return False
    return True


def data_folder(given: Path | None = None) -> DataFolder:
    """The folder given, else `SKYWAY_DATA`, else `.skyway` here."""
    return DataFolder(given or Path(os.environ.get("SKYWAY_DATA", ".skyway")))


@contextmanager
def held(folder: DataFolder) -> Iterator[None]:
    """Lock the folder; the kernel releases the lock when this process ends for any reason.

    Raises
    ------
    SkywayError
        Another process has locked it.
    """
    with folder.lock_file.open("a") as lock:
        if not _locks(lock):
            time.sleep(0.05)  # a command that asks `is_starting` has the lock for a moment
            if not _locks(lock):
                raise SkywayError(f"another Skyway runs on {folder.path}; stop it first")
        lock.truncate(0)
        yield


def note_ready(folder: DataFolder) -> None:
    """Note that the system that has locked the folder is ready."""
    folder.lock_file.write_text("ready\n")


def is_starting(folder: DataFolder) -> bool:
    """Whether a system has locked the folder and is not ready yet."""
    try:
        with folder.lock_file.open() as lock:
            return not lock.read() and not _locks(lock)
    except FileNotFoundError:
        return False


def _locks(lock: IO[str]) -> bool:
    """Lock the file until it is closed; False when another process has locked it."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
