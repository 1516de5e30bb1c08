"""A small disk for the SQLite databases, so that it can be full: a file system in memory."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from skyway.cli.data_folder import CLOUD_SERVICES, DataFolder

#: Enough for the databases of a long run.
_SIZE: Final = "512m"


@dataclass(frozen=True, slots=True)
class SmallDisk:
    """A mounted file system."""

    path: Path

    @property
    def _ballast(self) -> Path:
        return self.path / "ballast"

    def fill(self) -> None:
        """Use all the room that is left."""
        free = os.statvfs(self.path)
        with self._ballast.open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, free.f_bavail * free.f_frsize)

    def empty(self) -> None:
        """Give the room back."""
        self._ballast.unlink(missing_ok=True)


@contextmanager
def small_disk(folder: DataFolder) -> Iterator[SmallDisk | None]:
    """Mount a disk and let the databases be there; None where this process may not mount."""
    path = folder.path / "databases"
    path.mkdir(mode=0o700)
    mount = ["mount", "-t", "tmpfs", "-o", f"size={_SIZE},mode=700", "skyway-chaos", str(path)]
    if os.geteuid() != 0 or subprocess.run(mount, check=False).returncode != 0:
        yield None
        return
    try:
        for service in CLOUD_SERVICES:
            (folder.path / f"{service}.db").symlink_to(path / f"{service}.db")
        yield SmallDisk(path)
    finally:
        # Detached even when something still has a file open there.
        subprocess.run(["umount", "--lazy", str(path)], check=True)
