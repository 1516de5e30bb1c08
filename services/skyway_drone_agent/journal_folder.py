"""The folder of a fleet's journals, used by one process at a time."""

import fcntl
import os
from pathlib import Path
from types import TracebackType
from typing import Self

from skyway.errors import SkywayError
from skyway.ids import DroneId
from skyway_drone_agent.journal import FileJournal


class FolderInUse(SkywayError):
    """Another agent writes journals in this folder."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"{path}: another agent is using this journal folder")
        self.path = path


class JournalFolder:
    """Holds one journal per drone and the fleet clock's anchor; locked while it is open."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock: int | None = None

    def __enter__(self) -> Self:
        self._path.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._lock = os.open(self._path / "lock", os.O_RDWR | os.O_CREAT, 0o600)
        try:
            # The kernel lets go of it when this process dies, however it dies.
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            os.close(self._lock)
            raise FolderInUse(self._path) from error
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._lock is not None:
            os.close(self._lock)

    @property
    def clock_file(self) -> Path:
        """Where the fleet clock's anchor is kept."""
        return self._path / "clock.json"

    def journal_of(self, drone_id: DroneId) -> FileJournal:
        """The journal of one drone."""
        return FileJournal(self._path / f"{drone_id}.jsonl")
