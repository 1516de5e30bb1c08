"""The folder of journals; a lock lets only one process serve a drone."""

import fcntl
import os
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

from skyway.errors import SkywayError
from skyway.ids import DroneId
from skyway_drone_agent.journal.journal import FileJournal


class DroneInUse(SkywayError):
    """Another agent process serves this drone."""

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
