"""The flight recorder: the journal and the logbook in step, and word to whoever watches."""

import asyncio
from datetime import datetime

from skyway.ids import DroneId
from skyway_drone_agent.journal import Journal
from skyway_drone_agent.logbook import Logbook, logbook_after
from skyway_drone_agent.records import Record


class FlightRecorder:
    """The only writer of a drone's journal; `logbook` is always what the journal says."""

    def __init__(self, journal: Journal, *, drone_id: DroneId, at_first: Logbook) -> None:
        self.drone_id = drone_id
        self._journal = journal
        self._watchers: list[asyncio.Event] = []
        self.logbook = journal.read(at_first=at_first)

    def begin_session(self, wall_now: datetime) -> None:
        """Start a session above all earlier ones, also when the journal was lost meanwhile."""
        session = max(self.logbook.session + 1, int(wall_now.timestamp()))
        self.logbook = self.logbook.model_copy(update={"session": session})
        self._journal.compact(self.logbook)

    def record(self, *records: Record) -> None:
        """Write the records to the disk; only then do they count."""
        self._journal.append(records)
        for record in records:
            self.logbook = logbook_after(self.logbook, record)
        self.tell_watchers()

    def watch(self) -> asyncio.Event:
        """An event that is set whenever there is something new; the watcher clears it."""
        watcher = asyncio.Event()
        self._watchers.append(watcher)
        return watcher

    def tell_watchers(self) -> None:
        """Have all watchers look again, for what changed outside the journal."""
        for watcher in self._watchers:
            watcher.set()
