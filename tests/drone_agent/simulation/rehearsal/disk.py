"""A drone's disk: a real journal file with the power cuts and full disks of a story."""

import errno
import os
import stat
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from skyway_drone_agent.journal.journal import FileJournal
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.record_effects import logbook_after
from skyway_drone_agent.journal.records import EventRecorded, Record


class PowerCut(Exception):
    """The process dies here."""


#: When the power fails, seen from a write: before it, within it, or once it is on the disk.
Moment = Literal["before", "torn", "after"]


@dataclass(frozen=True, slots=True)
class Crash:
    """The power fails at the nth write of a story; the drone starts again after `down_s`."""

    at_write: int
    moment: Moment

    @property
    def down_s(self) -> float:
        """Within a step, or beyond its end (fleet time)."""
        return (2.0, 60.0, 300.0)[self.at_write % 3]


class Disk:
    """What a power cut leaves of the journal, and what that adds up to: `kept`."""

    def __init__(self, folder: Path, at_first: Logbook) -> None:
        self.path = folder / "drn_1.jsonl"
        self.is_full = False
        #: Whether the power has failed on a full disk: what happened meanwhile was in memory only.
        self.has_forgotten = False
        self.writes = 0
        self.kept = at_first
        self.records: list[Record] = []
        self.crash: Crash | None = None
        self._synced_bytes: dict[int, int] = {}

    def sync(self, file: int) -> None:
        """Keep what was written to the file, as fsync does."""
        if self.is_full:
            raise OSError(errno.ENOSPC, "full")
        status = os.fstat(file)
        if stat.S_ISREG(status.st_mode):
            self._synced_bytes[status.st_ino] = status.st_size

    def has_synced(self) -> bool:
        """Whether all of the journal would survive a power cut now."""
        status = self.path.stat()
        return self._synced_bytes.get(status.st_ino, 0) == status.st_size

    def lose_power(self) -> None:
        """Drop unsynced data; half of a torn line may stay."""
        self.has_forgotten = self.has_forgotten or self.is_full
        if not self.path.exists():
            return
        status = self.path.stat()
        synced = self._synced_bytes.get(status.st_ino, 0)
        if self.crash is not None and self.crash.moment == "torn" and status.st_size > synced:
            synced += (status.st_size - synced) // 2
        os.truncate(self.path, synced)
        self._synced_bytes[status.st_ino] = synced


class MortalJournal:
    """The journal of one process on a disk; `die` ends the process at a write."""

    def __init__(self, disk: Disk, die: Callable[[], None]) -> None:
        self._disk = disk
        self._die = die
        self._file = FileJournal(disk.path, sync=disk.sync)
        self._is_dead = False

    def read(self, *, at_first: Logbook) -> Logbook:
        return self._file.read(at_first=at_first)

    def append(self, records: Sequence[Record]) -> None:
        self._write(lambda: self._file.append(records))
        if self._disk.has_synced():
            for record in records:
                self._disk.kept = logbook_after(self._disk.kept, record)
                self._disk.records.append(record)
        self._end_write()

    def compact(self, logbook: Logbook) -> None:
        self._write(lambda: self._file.compact(logbook))
        # What happened on a full disk is written with the logbook as a whole.
        known_seq = self._disk.kept.last_event_seq
        self._disk.records += [
            EventRecorded(event=event) for event in logbook.events if event.seq > known_seq
        ]
        self._disk.kept = logbook
        self._end_write()

    def die(self) -> None:
        self._is_dead = True

    def _write(self, write: Callable[[], None]) -> None:
        if self._is_dead:
            raise PowerCut
        disk = self._disk
        disk.writes += 1
        if self._fails("before"):
            self._cut()
        if self._fails("torn"):
            file = os.open(disk.path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
            os.write(file, b'{"kind":"EVENT","event":{"eve')
            os.close(file)
            self._cut()
        write()

    def _end_write(self) -> None:
        if self._fails("after"):
            self._cut()

    def _fails(self, moment: Moment) -> bool:
        crash = self._disk.crash
        return crash is not None and crash.moment == moment and self._disk.writes == crash.at_write

    def _cut(self) -> None:
        self._die()
        raise PowerCut
