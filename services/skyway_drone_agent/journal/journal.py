"""The journal: an append-only file of records that survives kill -9 and loss of power.

The journals lie in one folder, where a lock lets only one process serve a drone.
"""

import contextlib
import fcntl
import logging
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from pydantic import TypeAdapter

from skyway.errors import SkywayError
from skyway.ids import DroneId
from skyway.runtime.errors import ExitCode
from skyway_drone_agent.journal.checksum import has_checksum, with_checksum, without_checksum
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.record_effects import logbook_after
from skyway_drone_agent.journal.records import Record, RecordLine

log = logging.getLogger(__name__)

_LINE: TypeAdapter[Record] = TypeAdapter(RecordLine)


class Journal(Protocol):
    """Keeps records. Once `append` or `compact` has returned, its records are never lost.

    Both raise `JournalUnwritable` when they cannot write; then nothing has changed.
    """

    def read(self, *, at_first: Logbook) -> Logbook:
        """The sum of the kept records; `at_first` for a drone without any."""
        ...

    def append(self, records: Sequence[Record]) -> None:
        """Keep these records, in order; after a crash only the first of them may be kept."""
        ...

    def compact(self, logbook: Logbook) -> None:
        """Replace all records by this logbook, all or nothing."""
        ...


class DamagedLine(SkywayError):
    """A whole line of a journal has changed on disk; `before` sums the lines before it."""

    def __init__(self, number: int, before: Logbook) -> None:
        super().__init__(f"line {number} is damaged")
        self.before = before


class JournalUnwritable(SkywayError):
    """The disk is full, or writing fails for another reason."""

    exit_code = ExitCode.NOT_NOW

    def __init__(self, path: Path, cause: OSError) -> None:
        super().__init__(f"{path}: {cause.strerror or cause}")
        self.path = path


class FileJournal:
    """JSON lines with checksums: the logbook at the last start, then one record a line.

    A damaged journal is set aside for people, and counts as lost, because it is unknown which of
    its records the cloud has read. The drone then begins a new journal at the place that the lines
    before the damage name.

    Writing blocks the event loop on purpose: a decision and its record cannot drift apart, and the
    drone must not act before the record is written.

    Parameters
    ----------
    sync
        Flushes a file to the disk; takes a file descriptor.
    """

    def __init__(self, path: Path, *, sync: Callable[[int], None] = os.fsync) -> None:
        self._path = path
        self._sync = sync

    def read(self, *, at_first: Logbook) -> Logbook:
        """The sum of the kept records, without a torn last line, which never took effect."""
        if not self._path.exists():
            return at_first
        try:
            return _sum_of(self._path.read_bytes(), at_first=at_first)
        except DamagedLine as damage:
            return self._begun_anew(damage, at_first=at_first)

    def _begun_anew(self, damage: DamagedLine, *, at_first: Logbook) -> Logbook:
        kept = self._set_aside()
        log.error("journal lost: %s; it is kept as %s", damage, kept)
        return damage.before.begun_anew(at_first=at_first)

    def _set_aside(self) -> Path:
        """Rename the file to the first free name; returns that name."""
        for number in count(1):
            aside = self._path.with_suffix(f".damaged-{number}")
            if not aside.exists():
                break
        try:
            self._path.rename(aside)
            self._sync_folder()
        except OSError as error:
            raise JournalUnwritable(self._path, error) from error
        return aside

    def append(self, records: Sequence[Record]) -> None:
        """Write the records after the others and wait for the disk."""
        try:
            self._write(self._path, os.O_APPEND, records)
        except OSError as error:
            raise JournalUnwritable(self._path, error) from error

    def compact(self, logbook: Logbook) -> None:
        """Replace the whole file, so that a crash leaves either the old or the new file."""
        beside = self._path.with_suffix(".new")
        try:
            self._write(beside, os.O_TRUNC, [logbook])
            beside.replace(self._path)
            self._sync_folder()
        except OSError as error:
            # The unfinished file uses disk space that is needed.
            with contextlib.suppress(OSError):
                beside.unlink(missing_ok=True)
            raise JournalUnwritable(self._path, error) from error

    def _sync_folder(self) -> None:
        folder = os.open(self._path.parent, os.O_RDONLY)
        try:
            self._sync(folder)
        finally:
            os.close(folder)

    def _write(self, path: Path, flag: int, entries: Sequence[Record | Logbook]) -> None:
        # Opened for each write: a fleet of thousands must not hold a file open for each drone.
        file = os.open(path, os.O_WRONLY | os.O_CREAT | flag, 0o600)
        try:
            length = os.fstat(file).st_size
            try:
                lines = (with_checksum(each.model_dump_json()) + b"\n" for each in entries)
                self._write_all(file, b"".join(lines))
            except OSError:
                # A torn line in the middle would make the lines after it unreadable.
                os.ftruncate(file, length)
                raise
        finally:
            os.close(file)

    def _write_all(self, file: int, text: bytes) -> None:
        while text:
            text = text[os.write(file, text) :]
        self._sync(file)


def _sum_of(content: bytes, *, at_first: Logbook) -> Logbook:
    """The sum of the whole lines of a journal.

    Raises
    ------
    DamagedLine
        A line cannot be read, or is not as it was written.
    """
    *lines, rest = content.split(b"\n")
    for last in (rest, rest[:-1]):  # only the end of the line is missing, or has changed
        if has_checksum(last):
            lines.append(last)
            break
    logbook = at_first
    for number, line in enumerate(lines, start=1):
        try:
            text = without_checksum(line)
            if number == 1:
                logbook = Logbook.read(text)
            else:
                logbook = logbook_after(logbook, _LINE.validate_json(text))
        except ValueError as error:
            raise DamagedLine(number, before=logbook) from error
    return logbook


class DroneInUse(SkywayError):
    """Another agent process serves this drone."""

    exit_code = ExitCode.NOT_NOW

    def __init__(self, drone_id: DroneId, path: Path) -> None:
        super().__init__(f"{path}: another agent serves drone {drone_id}")
        self.drone_id = drone_id
        self.path = path


class JournalFolder:
    """One journal per drone, and the fleet clock's anchor; processes may share the folder.

    While it is open, no other process can open it for the same drones.
    """

    def __init__(self, path: Path, drone_ids: Iterable[DroneId]) -> None:
        self._path = path
        self._drone_ids = tuple(drone_ids)
        self._locks = ExitStack()

    def __enter__(self) -> Self:
        self._path.mkdir(parents=True, exist_ok=True, mode=0o700)
        try:
            for drone_id in self._drone_ids:
                self._lock(drone_id)
        except BaseException:
            self._locks.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._locks.close()

    @property
    def path(self) -> Path:
        """The folder, which only this user can read."""
        return self._path

    @property
    def clock_file(self) -> Path:
        """Where the fleet clock's anchor is kept."""
        return self._path / "clock.json"

    @property
    def landing_book_file(self) -> Path:
        """Where the stations around the drones' routes are kept."""
        return self._path / "landing-book.json"

    def journal_of(self, drone_id: DroneId) -> FileJournal:
        """The journal of one drone."""
        return FileJournal(self._path / f"{drone_id}.jsonl")

    def _lock(self, drone_id: DroneId) -> None:
        file = os.open(self._path / f"{drone_id}.lock", os.O_RDWR | os.O_CREAT, 0o600)
        self._locks.callback(os.close, file)
        try:
            # The kernel releases the lock when this process dies, also after kill -9.
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise DroneInUse(drone_id, self._path) from error
