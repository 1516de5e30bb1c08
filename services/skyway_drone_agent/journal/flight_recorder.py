"""The flight recorder: writes the journal, keeps the logbook, and notifies watchers.

Watchers wait for its news, or for a moment of fleet time, whichever comes first.
"""

import asyncio
import logging
from datetime import datetime
from functools import reduce
from typing import Any, Self

from skyway.contracts.drone_report import DroneEvent
from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway_drone_agent.journal.journal import Journal, JournalUnwritable
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.record_effects import logbook_after
from skyway_drone_agent.journal.records import Record

log = logging.getLogger(__name__)


class FlightRecorder:
    """The only writer of a drone's journal; `logbook` is the sum of its records.

    While the disk is full, the logbook is ahead of the journal. Events that are not written yet are
    not reported to the cloud: after a power cut their numbers would be used again.
    """

    def __init__(self, journal: Journal, *, drone_id: DroneId, at_first: Logbook) -> None:
        self.drone_id = drone_id
        self._journal = journal
        self._watchers: list[asyncio.Event] = []
        self._unwritten: list[Record] = []
        self.logbook = self._written = journal.read(at_first=at_first)
        self.is_full = False
        self._can_append = True

    @property
    def written_events(self) -> tuple[DroneEvent, ...]:
        """The events that may be reported to the cloud."""
        return self._written.events

    @property
    def reported_logbook(self) -> Logbook:
        """The logbook for reports to the cloud: without the number of an event not yet written.

        After a power cut another event would get that number.
        """
        if self._written is self.logbook:
            return self.logbook
        written_seq = self._written.last_event_seq
        return self.logbook.model_copy(update={"last_event_seq": written_seq})

    @property
    def has_session(self) -> bool:
        """Whether the session is written; until then a later start could use the same number."""
        return self._written.session == self.logbook.session

    def begin_session(self, wall_now: datetime) -> None:
        """Start a session with a higher number than all before, even if the journal was lost."""
        session = max(self.logbook.session + 1, int(wall_now.timestamp()))
        first_session = self.logbook.first_session or session
        self.logbook = self.logbook.model_copy(
            update={"session": session, "first_session": first_session}
        )
        # Its last line may be torn, or the file may be missing, until it is rewritten.
        self._can_append = False
        self.make_room()

    def record(self, *records: Record) -> None:
        """Write the records to the disk; they take effect after that.

        Raises
        ------
        JournalUnwritable
            The disk is full or fails: nothing in the records may begin.
        """
        try:
            self._write(records)
        except JournalUnwritable:
            self._note_full()
            raise
        self._count(records)
        self._written = self.logbook

    def note(self, *records: Record) -> None:
        """Write records that take effect in any case; on a full disk they are written later."""
        try:
            self._write(records)
        except JournalUnwritable:
            self._unwritten += records
            self._note_full()
            self._count(records)
            return
        self._count(records)
        self._written = self.logbook

    def make_room(self) -> None:
        """Rewrite the journal as one line; if the disk is full, a later call tries again."""
        try:
            self._journal.compact(self.logbook)
        except JournalUnwritable:
            self._note_full()
            return
        self._written = self.logbook
        self._unwritten.clear()
        self._can_append = True
        if self.is_full:
            self.is_full = False
            log.info("journal written again", extra={"drone_id": self.drone_id})
            self.notify_watchers()

    def watch(self) -> asyncio.Event:
        """An event that is set for every new record; the watcher clears it."""
        watcher = asyncio.Event()
        self._watchers.append(watcher)
        return watcher

    def notify_watchers(self) -> None:
        """Wake all watchers, also for a change outside the journal."""
        for watcher in self._watchers:
            watcher.set()

    def _write(self, records: tuple[Record, ...]) -> None:
        if self._can_append:
            self._journal.append([*self._unwritten, *records])
        else:
            self._journal.compact(reduce(logbook_after, records, self.logbook))
            self._can_append = True
        self._unwritten.clear()

    def _count(self, records: tuple[Record, ...]) -> None:
        for record in records:
            self.logbook = logbook_after(self.logbook, record)
        self.notify_watchers()

    def _note_full(self) -> None:
        if not self.is_full:
            self.is_full = True
            log.error("journal cannot be written", extra={"drone_id": self.drone_id})
            self.notify_watchers()


class NewsOrMoment:
    """Waits repeatedly, while the block lasts, for news or for a moment of fleet time.

    One task sleeps through all the waits, because news comes often and then the moment moves on. A
    task for each wait took a tenth of a fleet's processor time.
    """

    def __init__(self, news: asyncio.Event, clock: FleetClock) -> None:
        self._news = news
        self._clock = clock
        #: The moment that is waited for; None without one and while nobody waits.
        self._moment: datetime | None = None
        self._sleeping: asyncio.Task[None] | None = None
        self._sleeps_until: datetime | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._wake()

    async def wait(self, *, until: datetime | None) -> None:
        """Return when there is news, which is then cleared, or when the moment has come."""
        self._moment = until
        if until is not None and not self._is_woken_by(until):
            self._wake()
            self._sleeps_until = until
            self._sleeping = asyncio.ensure_future(self._sleep())
            self._sleeping.add_done_callback(self._has_come)
        await self._news.wait()
        self._news.clear()
        self._moment = None
        if self._sleeping is not None and self._sleeping.done():
            self._sleeping.result()

    def _is_woken_by(self, moment: datetime) -> bool:
        """Whether the current sleep ends at that moment or earlier."""
        is_asleep = self._sleeping is not None and not self._sleeping.done()
        return is_asleep and self._sleeps_until is not None and self._sleeps_until <= moment

    async def _sleep(self) -> None:
        while self._sleeps_until is not None:
            await self._clock.sleep_until(self._sleeps_until)
            if self._moment is None or self._moment <= self._sleeps_until:
                return
            self._sleeps_until = self._moment

    def _has_come(self, slept: "asyncio.Task[None]") -> None:
        """Treat the moment as news, so that `wait` waits for one event only."""
        if self._moment is not None and slept is self._sleeping:
            self._news.set()

    def _wake(self) -> None:
        if self._sleeping is not None:
            self._sleeping.cancel()
            self._sleeping = None


async def wait_for_end_or_news(performing: asyncio.Future[Any], news: asyncio.Event) -> None:
    """Return when the step is done, or when there is news, which is then cleared."""
    receiving = asyncio.ensure_future(news.wait())
    try:
        await asyncio.wait((performing, receiving), return_when=asyncio.FIRST_COMPLETED)
    finally:
        receiving.cancel()
    news.clear()
