"""A journal that is only in memory."""

from collections.abc import Sequence

from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.record_effects import logbook_after
from skyway_drone_agent.journal.records import Record


class MemoryJournal:
    """A journal in memory with the promises of the file."""

    def __init__(self) -> None:
        self.records: list[Record] = []
        self._kept: Logbook | None = None

    def read(self, *, at_first: Logbook) -> Logbook:
        """The sum of the kept records."""
        logbook = self._kept or at_first
        for record in self.records:
            logbook = logbook_after(logbook, record)
        return logbook

    def append(self, records: Sequence[Record]) -> None:
        """Keep the records after the others."""
        self.records.extend(records)

    def compact(self, logbook: Logbook) -> None:
        """Keep this logbook instead of the records."""
        self._kept, self.records = logbook, []
