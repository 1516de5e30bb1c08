"""A share of a core for each process, so that a small machine can be measured on a large one."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from skyway_lab.benchmarks.load.cpu import with_descendants

from skyway.errors import SkywayError

_PERIOD_US: Final = 100_000
_CGROUPS: Final = Path("/sys/fs/cgroup")
#: Where each version of cgroups has the limits of processors.
_VERSION_2: Final = _CGROUPS / "cgroup.controllers"
_VERSION_1: Final = _CGROUPS / "cpu"


@contextmanager
def limited(pids: Mapping[str, int], share: float | None) -> Iterator[None]:
    """Let each of these processes, with its children, take this share of a core for the block.

    None sets no limit.

    Raises
    ------
    SkywayError
        Control groups cannot be written here: it needs Linux, and to run as root.
    """
    groups: list[Path] = []
    try:
        for name, pid in pids.items() if share is not None else ():
            group = _parent() / f"skyway-{os.getpid()}-{name.replace(' ', '-')}"
            try:
                group.mkdir()
                groups.append(group)
                _limit(group, round(_PERIOD_US * (share or 1.0)))
                for one in with_descendants([pid]):
                    (group / "cgroup.procs").write_text(str(one))
            except OSError as error:
                raise SkywayError(f"no share of a core can be set in {group}: {error}") from error
        yield
    finally:
        for group in groups:
            for pid_text in (group / "cgroup.procs").read_text().split():
                (_parent() / "cgroup.procs").write_text(pid_text)
            group.rmdir()


def _parent() -> Path:
    return _CGROUPS if _VERSION_2.exists() else _VERSION_1


def _limit(group: Path, quota_us: int) -> None:
    if _VERSION_2.exists():
        (group / "cpu.max").write_text(f"{quota_us} {_PERIOD_US}")
    else:
        (group / "cpu.cfs_period_us").write_text(str(_PERIOD_US))
        (group / "cpu.cfs_quota_us").write_text(str(quota_us))
