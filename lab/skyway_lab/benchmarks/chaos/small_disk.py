"""A small disk for the SQLite databases, so that it can be full: a file system in memory.

A benchmark that is killed leaves its disk mounted. The next one unmounts it: the name of a disk
holds the id of the process that has mounted it.
"""

import errno
import os
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from skyway.cli.data_folder import CLOUD_SERVICES, DataFolder

#: Enough for the databases of a long run.
_SIZE: Final = "512m"
#: Disks are called this and the process id.
_NAME: Final = "skyway-chaos-"
_MOUNTS: Final = Path("/proc/self/mounts")
#: What is written step by step, because the services use the same room meanwhile.
_BLOCK_BYTES: Final = 4096


@dataclass(frozen=True, slots=True)
class SmallDisk:
    """A mounted file system."""

    path: Path

    @property
    def _ballast(self) -> Path:
        return self.path / "ballast"

    def fill(self) -> None:
        """Use all the room that is left, also what becomes free while this writes."""
        free = os.statvfs(self.path)
        most_blocks = free.f_bavail * free.f_frsize // _BLOCK_BYTES + 1
        with self._ballast.open("wb", buffering=0) as file:
            for block_count in (256, 1):
                for _ in range(most_blocks):
                    try:
                        file.write(bytes(block_count * _BLOCK_BYTES))
                    except OSError as error:
                        if error.errno != errno.ENOSPC:
                            raise
                        break

    def empty(self) -> None:
        """Give the room back."""
        self._ballast.unlink(missing_ok=True)


@contextmanager
def small_disk(folder: DataFolder) -> Iterator[SmallDisk | None]:
    """Mount a disk and let the databases be there; None where this process may not mount."""
    path = folder.path / "databases"
    path.mkdir(mode=0o700)
    if os.geteuid() == 0:
        for left in left_mounted(_MOUNTS.read_text().splitlines()):
            subprocess.run(["umount", "--lazy", left], check=False)
    name = f"{_NAME}{os.getpid()}"
    mount = ["mount", "-t", "tmpfs", "-o", f"size={_SIZE},mode=700", name, str(path)]
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


def left_mounted(mounts: Iterable[str]) -> list[str]:
    """Where disks of processes that are gone are mounted, by the lines of `/proc/self/mounts`."""
    left = []
    for name, path, *_ in (line.split() for line in mounts):
        owner = name.removeprefix(_NAME)
        if owner != name and owner.isdigit() and not Path("/proc", owner).exists():
            left.append(path)
    return left
