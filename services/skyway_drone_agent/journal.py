"""The journal: an append-only file of records that survives kill -9 and loss of power."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

from pydantic import TypeAdapter, ValidationError

from skyway.errors import SkywayError
from skyway_drone_agent.logbook import Logbook, logbook_after
from skyway_drone_agent.records import Record, RecordLine

_LINE: TypeAdapter[Record] = TypeAdapter(RecordLine)


class Journal(Protocol):
    """Where records are kept; what `append` or `compact` returned from is never lost."""

    def read(self, *, at_first: Logbook) -> Logbook:
        """The sum of what is kept; `at_first` for a drone that has written nothing yet."""
        ...

    def append(self, records: Sequence[Record]) -> None:
        """Keep these records, in order; a crash may keep a first part of them."""
        ...

    def compact(self, logbook: Logbook) -> None:
        """Keep this logbook instead of the records that led to it, all or nothing."""
        ...


class DamagedJournal(SkywayError):
    """A line before the last cannot be read: not a torn write, so nobody may guess."""

    def __init__(self, path: Path, line: int) -> None:
        super().__init__(f"{path}: line {line} is damaged")
        self.path = path
        self.line = line


class FileJournal:
    """JSON lines: the logbook at the last start, then one record a line.

    Writing blocks the event loop on purpose: what is decided and what is written cannot drift
    apart, and a drone has nothing better to do before it acts.

    Parameters
    ----------
    sync
        Brings what was written to the disk itself; takes a file descriptor.
    """

    def __init__(self, path: Path, *, sync: Callable[[int], None] = os.fsync) -> None:
        self._path = path
        self._sync = sync

    def read(self, *, at_first: Logbook) -> Logbook:
        """The sum of what is kept; a torn last line was never acted upon and is left out."""
        if not self._path.exists():
            return at_first
        *whole_lines, _torn = self._path.read_bytes().split(b"\n")
        logbook = at_first
        for number, line in enumerate(whole_lines, start=1):
            try:
                if number == 1:
                    logbook = Logbook.read(line)
                else:
                    logbook = logbook_after(logbook, _LINE.validate_json(line))
            except ValidationError as error:
                raise DamagedJournal(self._path, number) from error
        return logbook

    def append(self, records: Sequence[Record]) -> None:
        """Write the records behind the others and wait for the disk."""
        self._write(self._path, os.O_APPEND, [record.model_dump_json() for record in records])

    def compact(self, logbook: Logbook) -> None:
        """Replace the file as a whole, so that a crash leaves the old one or the new one."""
        beside = self._path.with_suffix(".new")
        self._write(beside, os.O_TRUNC, [logbook.model_dump_json()])
        beside.replace(self._path)
        folder = os.open(self._path.parent, os.O_RDONLY)
        try:
            self._sync(folder)
        finally:
            os.close(folder)

    def _write(self, path: Path, flag: int, lines: Sequence[str]) -> None:
        # Opened for each write, so that a fleet of thousands holds no file open per drone.
        file = os.open(path, os.O_WRONLY | os.O_CREAT | flag, 0o600)
        try:
            text = b"".join(line.encode() + b"\n" for line in lines)
            while text:
                text = text[os.write(file, text) :]
            self._sync(file)
        finally:
            os.close(file)
