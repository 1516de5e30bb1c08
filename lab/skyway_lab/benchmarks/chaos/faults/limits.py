"""Faults by limits that Linux sets a process: of open files, of memory, of how long files are."""

import resource
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Final

from skyway_lab.benchmarks.chaos.faults.stage import Stage
from skyway_lab.benchmarks.chaos.schedule import PlannedFault

#: Files and connections that a process may still open: not enough for a request that calls others.
_SPARE_DESCRIPTORS: Final = 1
#: What an allocator still has of its own lasts a little longer than this.
_SPARE_MEMORY_BYTES: Final = 1 << 20
#: Every journal is longer, so that nothing can be appended, and a new file cannot be written.
_LONGEST_FILE_BYTES: Final = 64


@asynccontextmanager
async def no_descriptors(stage: Stage, fault: PlannedFault) -> AsyncIterator[None]:
    """Let the processes of a target open almost no further file."""

    def lowest(pid: int) -> int:
        return len(list(Path(f"/proc/{pid}/fd").iterdir())) + _SPARE_DESCRIPTORS

    pids = stage.running.processes.pids(fault.target)
    before = list(_limited(pids, resource.RLIMIT_NOFILE, lowest))
    try:
        yield
    finally:
        _restore(before, resource.RLIMIT_NOFILE)


@asynccontextmanager
async def unwritable_journals(stage: Stage, fault: PlannedFault) -> AsyncIterator[None]:
    """Let the processes of a target write no file: each write fails as on a full disk."""
    pids = stage.running.processes.pids(fault.target)
    before = list(_limited(pids, resource.RLIMIT_FSIZE, lambda _: _LONGEST_FILE_BYTES))
    try:
        yield
    finally:
        _restore(before, resource.RLIMIT_FSIZE)


@asynccontextmanager
async def no_memory(stage: Stage, fault: PlannedFault) -> AsyncIterator[None]:
    """Let the processes of a target get almost no further memory."""
    pids = stage.running.processes.pids(fault.target)
    before = list(
        _limited(pids, resource.RLIMIT_AS, lambda pid: _memory_bytes(pid) + _SPARE_MEMORY_BYTES)
    )
    try:
        yield
    finally:
        _restore(before, resource.RLIMIT_AS)


def _memory_bytes(pid: int) -> int:
    """The size of a process's address space (proc(5), statm)."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[0])
    return pages * resource.getpagesize()


Limits = tuple[int, tuple[int, int]]


def _limited(pids: Iterable[int], what: int, limit: Callable[[int], int]) -> Iterable[Limits]:
    """Lower a limit of these processes; returns what it was before for those still running."""
    for pid in pids:
        with suppress(ProcessLookupError, FileNotFoundError):
            soft, hard = resource.prlimit(pid, what)
            resource.prlimit(pid, what, (limit(pid), hard))
            yield pid, (soft, hard)


def _restore(before: Iterable[Limits], what: int) -> None:
    for pid, limits in before:
        with suppress(ProcessLookupError):
            resource.prlimit(pid, what, limits)
