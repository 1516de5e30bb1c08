"""The loop over all deliveries with packages that wait: as many are booked at once as may be."""

import asyncio
import logging
from typing import Final, Never

from skyway.runtime.loops import repeat
from skyway.runtime.metrics import count
from skyway_gateway.deliveries.book import Booker
from skyway_gateway.deliveries.rows import Queued

log = logging.getLogger(__name__)

#: Seconds of wall time between two looks at a queue that nobody has told of.
_LOOK_EVERY_S: Final = 0.5


class BookingLoop:
    """Claims what is due, `most` at a time, and books each on its own: none waits for a slow one.

    One look claims for all: a worker for each booking would look, and commit, as often as there
    are workers.
    """

    def __init__(self, booker: Booker, *, most: int) -> None:
        self._booker = booker
        self._most = most
        self._under_way: set[asyncio.Task[None]] = set()

    async def run(self) -> Never:
        """Book for ever."""
        async with asyncio.TaskGroup() as group:
            await repeat(
                "book",
                lambda: self._step(group),
                every_s=_LOOK_EVERY_S,
                wake=self._booker.queued,
            )

    async def _step(self, group: asyncio.TaskGroup) -> bool:
        """Begin to book what is due; False, since whoever queues or finishes wakes the loop."""
        free = self._most - len(self._under_way)
        if free:
            for queued in await self._booker.claim(limit=free):
                task = group.create_task(self._book(queued))
                self._under_way.add(task)
                task.add_done_callback(self._finished)
        return False

    def _finished(self, task: asyncio.Task[None]) -> None:
        if len(self._under_way) == self._most:  # more may be due than could be claimed
            self._booker.queued.set()
        self._under_way.discard(task)

    async def _book(self, queued: Queued) -> None:
        """Book one; whatever goes wrong, its claim runs out."""
        try:
            await self._booker.book_or_retry(queued)
        except Exception:
            count("skyway_loop_failures", "steps of loops that failed", loop="book")
            log.exception("booking failed", extra={"delivery_id": queued.delivery.delivery_id})
