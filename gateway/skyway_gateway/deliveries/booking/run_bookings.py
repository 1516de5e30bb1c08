"""The loop over all deliveries with packages that wait: as many are booked at once as may be."""

import asyncio
import logging
from typing import Final, Never

from skyway.ids import DeliveryId
from skyway.runtime.loops import Wake, repeat
from skyway.runtime.metrics import count
from skyway_gateway.deliveries.booking.book import Booker
from skyway_gateway.deliveries.records.stored_delivery import Queued

log = logging.getLogger(__name__)

#: Seconds of wall time between two looks at a queue that nobody has told of.
_LOOK_EVERY_S: Final = 0.5

#: Seconds of wall time after which claims are renewed: one that fails is soon repeated.
_HOLD_EVERY_S: Final = 1.0


class BookingLoop:
    """Books what it is handed, and what it finds due; each on its own: none waits for a slow one.

    As a rule a delivery is booked by the process that accepts it, which claims it in the row that
    it adds: nobody need look for it. One look claims all else, `most` at a time: a worker for each
    booking would look, and commit, as often as there are workers. Claims are short, and renewed:
    what a killed process was to book does not wait for long.
    """

    def __init__(self, queued: Wake, *, claimant: str, most: int) -> None:
        self.queued = queued
        self.claimant = claimant
        self._most = most
        self._places = asyncio.Semaphore(most)
        self._booker: Booker | None = None
        self._group = asyncio.TaskGroup()
        self._under_way: dict[asyncio.Task[None], DeliveryId] = {}
        self._is_behind = False

    @property
    def is_free(self) -> bool:
        """Whether to hand over what is accepted: not while something older may be waiting."""
        has_room = len(self._under_way) < self._most
        return self._booker is not None and has_room and not self._is_behind

    async def run(self, booker: Booker) -> Never:
        """Book for ever."""
        async with self._group as group:
            group.create_task(repeat("hold", lambda: self._hold(booker), every_s=_HOLD_EVERY_S))
            self._booker = booker
            try:
                await repeat(
                    "book", lambda: self._step(booker), every_s=_LOOK_EVERY_S, wake=self.queued
                )
            finally:
                self._booker = None

    def begin(self, queued: Queued) -> None:
        """Book a delivery that is ours; whoever is handed one as the process ends lets it be."""
        if self._booker is not None:
            task = self._group.create_task(self._book(self._booker, queued))
            self._under_way[task] = queued.delivery.delivery_id
            task.add_done_callback(self._finished)

    async def _step(self, booker: Booker) -> bool:
        """Begin to book what is due; False, since whoever queues or finishes wakes the loop."""
        free = max(0, self._most - len(self._under_way))
        self._is_behind = True  # until all that is due was claimed
        due = await booker.claim(limit=free) if free else []
        for queued in due:
            self.begin(queued)
        self._is_behind = len(due) == free
        return False

    async def _hold(self, booker: Booker) -> bool:
        """Hold on to what is under way; False, since the next time is in a while."""
        if self._under_way:
            await booker.hold(frozenset(self._under_way.values()))
        return False

    def _finished(self, task: asyncio.Task[None]) -> None:
        del self._under_way[task]
        if self._is_behind:
            self.queued.set()

    async def _book(self, booker: Booker, queued: Queued) -> None:
        """Book one in its turn; whatever goes wrong, its claim runs out."""
        try:
            # More may be handed over than there is room for: what one COMMIT has accepted.
            async with self._places:
                await booker.book_or_retry(queued)
        except Exception:
            count("skyway_loop_failures", "steps of loops that failed", loop="book")
            log.exception("booking failed", extra={"delivery_id": queued.delivery.delivery_id})
