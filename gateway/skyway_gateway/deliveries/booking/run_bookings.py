"""The loops that book all deliveries with packages that wait, several at the same time.

Requests with a pickup beyond the booking horizon wait as SCHEDULED, and hold nothing. The horizon
is a span of fleet time, and a delivery stores only its pickup. So a changed setting or clock rate
counts from the next look on, for deliveries that wait already too.
"""

import asyncio
import logging
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final, Never

from skyway.contracts.shortlist import Candidates
from skyway.delivery.qos import PRIORITY_RANKS
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, NetworkId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Overloaded, RemoteProblem, ServiceUnavailable
from skyway.runtime.loops import MissingParts, Wake, always, repeat
from skyway.runtime.metrics import count
from skyway.runtime.sql.database import Database
from skyway_gateway.deliveries.booking.book import Booker
from skyway_gateway.deliveries.booking.booking_round import RoundPace
from skyway_gateway.deliveries.booking.queue_store import scheduled_until, unanswered
from skyway_gateway.deliveries.lifecycle.booking_effects import give_up_at
from skyway_gateway.deliveries.lifecycle.progress import Progress, changed
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.deliveries.records.delivery_rows import QueuedDelivery
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter

log = logging.getLogger(__name__)

#: Seconds of wall time between two looks at the queue, unless something wakes the loop.
_LOOK_EVERY_S: Final = 0.5

#: Seconds of wall time between two renewals of the claims: a failed renewal is soon repeated.
_HOLD_EVERY_S: Final = 1.0

#: A request is refused when it would wait longer than this for its first round of booking, wall
#: seconds. A fifth of the 30 s within which an accepted request has its answer: the pace may fall
#: after the request was accepted, and the round itself takes time too.
_LONGEST_WAIT_S: Final = 6.0
#: How many deliveries are asked about at the same time because of reports about their missions.
_LEARNT_AT_ONCE: Final = 4

#: How many SCHEDULED deliveries one step requests.
_BATCH: Final = 100


class BookingLoop:
    """Books what it is given and what is due in the queue, each line in a task of its own.

    A line is one new delivery, or the requests of one network that wait for a drone and are due
    together. These compete for the same drones, so they are booked one after the other.

    The process that accepts a delivery usually books it: the new row is claimed already, so nobody
    has to look for it. One look at the queue claims everything else that is due, up to `most` at
    the same time; one look by each of several workers would cost as many commits as workers. Claims
    are short and renewed, so the deliveries of a killed process do not wait for long.
    """

    def __init__(self, queued: Wake, *, claimant: str, most: int) -> None:
        self.queued = queued
        self.claimant = claimant
        self.pace = RoundPace(most)
        self._most = most
        self._places = asyncio.Semaphore(most)
        self._booker: Booker | None = None
        self._group = asyncio.TaskGroup()
        self._under_way: dict[asyncio.Task[None], Sequence[QueuedDelivery]] = {}
        self._is_behind = False
        self._missing = MissingParts("bookings")
        self._unanswered = 0
        self._arriving = 0
        self._asking = asyncio.Semaphore(_LEARNT_AT_ONCE)
        self._learning: dict[DeliveryId, asyncio.Future[bool]] = {}

    def must_have_room(self, *, replicas: int) -> None:
        """Go on only if a request that comes now would soon be booked.

        Before it come the requests that have no answer yet, at the pace of the last rounds. Lost
        answers count; requests that wait for a drone do not. `replicas` share the work.

        Raises
        ------
        Overloaded
            It would wait longer than `_LONGEST_WAIT_S`.
        """
        wait_s = (self._unanswered + self._arriving) / self.pace.per_s() / replicas
        if wait_s > _LONGEST_WAIT_S:
            count("skyway_requests_shed", "delivery requests refused because of the load")
            raise Overloaded(wait_s, limit_s=_LONGEST_WAIT_S)

    @contextmanager
    def arriving(self) -> Iterator[None]:
        """Count a request for the block, in which it is checked and written."""
        self._arriving += 1
        try:
            yield
        finally:
            self._arriving -= 1

    def note_accepted(self) -> None:
        """Count a request that was written, until the next look at the queue."""
        self._unanswered += 1

    async def learn(self, booker: Booker, delivery_id: DeliveryId) -> bool:
        """Write what composition has booked for a delivery; False if it cannot be asked now.

        All who ask about one delivery meanwhile get the same answer.
        """
        if (running := self._learning.get(delivery_id)) is not None:
            return await asyncio.shield(running)
        outcome = self._learning[delivery_id] = asyncio.get_running_loop().create_future()
        is_booked = False
        try:
            async with self._asking:
                is_booked = await booker.learn(delivery_id)
        except (ServiceUnavailable, RemoteProblem) as trouble:
            self._missing.note(trouble)
        finally:
            del self._learning[delivery_id]
            outcome.set_result(is_booked)
        return is_booked

    @property
    def is_free(self) -> bool:
        """Whether a new delivery may start immediately: not while an older one may be waiting."""
        has_room = len(self._under_way) < self._most
        return self._booker is not None and has_room and not self._is_behind

    async def run(self, booker: Booker, *, polls: Callable[[], bool] = always) -> Never:
        """Book until the process ends; look at the queue unasked only while it `polls`."""
        async with self._group as group:
            group.create_task(repeat("hold", lambda: self._hold(booker), every_s=_HOLD_EVERY_S))
            backlog = repeat("backlog", lambda: self._look_back(booker), every_s=_HOLD_EVERY_S)
            group.create_task(backlog)
            self._booker = booker
            try:
                await repeat(
                    "book",
                    lambda: self._step(booker),
                    every_s=_LOOK_EVERY_S,
                    wake=self.queued,
                    polls=polls,
                )
            finally:
                self._booker = None

    def begin(self, queued: QueuedDelivery) -> None:
        """Start to book a delivery that we have claimed; while the process ends, do nothing."""
        if self._booker is not None:
            self._begin(self._booker, [queued])

    async def _step(self, booker: Booker) -> bool:
        """Start to book what is due; always False, because new work wakes the loop."""
        free = max(0, self._most - len(self._under_way))
        self._is_behind = True  # until everything that is due is claimed
        due = await booker.claim(limit=free) if free else []
        for line in _lines(due):
            self._begin(booker, line)
        self._is_behind = len(due) == free
        return False

    async def _hold(self, booker: Booker) -> bool:
        """Renew the claims of running bookings; always False, because the next time comes later."""
        held = [queued.delivery.delivery_id for line in self._under_way.values() for queued in line]
        if held:
            await booker.hold(frozenset(held))
        return False

    async def _look_back(self, booker: Booker) -> bool:
        """Count what has no answer yet; always False. Other replicas accept and book too."""
        if self._unanswered:
            self._unanswered = await unanswered(booker.db)
        return False

    def _begin(self, booker: Booker, line: Sequence[QueuedDelivery]) -> None:
        task = self._group.create_task(self._book(booker, line))
        self._under_way[task] = line
        task.add_done_callback(self._finished)

    def _finished(self, task: asyncio.Task[None]) -> None:
        del self._under_way[task]
        if self._is_behind:
            self.queued.set()

    async def _book(self, booker: Booker, line: Sequence[QueuedDelivery]) -> None:
        """Book the deliveries of a line in turn when there is a free place."""
        # One COMMIT may accept more deliveries than there are free places.
        async with self._places:
            found = await self._candidates_of(booker, line) if len(line) > 1 else {}
            for queued in line:
                await self._book_one(booker, queued, found.get(queued.delivery.delivery_id))

    async def _candidates_of(
        self, booker: Booker, line: Sequence[QueuedDelivery]
    ) -> Mapping[DeliveryId, Candidates]:
        """The candidates of a line; nothing if that fails: then each round asks for itself."""
        try:
            return await booker.candidates_of(line)
        except Exception as error:
            count("skyway_loop_failures", "steps of loops that failed", loop="book")
            if not self._missing.note(error):
                log.exception("candidates of a line could not be read")
            return {}

    async def _book_one(
        self, booker: Booker, queued: QueuedDelivery, candidates: Candidates | None
    ) -> None:
        """Book one delivery; if it fails, its claim runs out."""
        begun_s, has_asked = self.pace.begin(), True
        try:
            has_asked = await booker.book_or_retry(queued, candidates)
        except Exception as error:
            count("skyway_loop_failures", "steps of loops that failed", loop="book")
            if not self._missing.note(error):
                log.exception("booking failed", extra={"delivery_id": queued.delivery.delivery_id})
        else:
            self._missing.are_back()
        finally:
            self.pace.end(begun_s if has_asked else None)


def _lines(due: Sequence[QueuedDelivery]) -> list[list[QueuedDelivery]]:
    """The waiting requests of each network by class, then by age; each new delivery by itself."""
    alone = [[queued] for queued in due if not queued.is_waiting]
    waiting = defaultdict[NetworkId | None, list[QueuedDelivery]](list)
    for queued in sorted(due, key=_asking_order):
        if queued.is_waiting:
            waiting[queued.network_id].append(queued)
    return [*waiting.values(), *alone]


def _asking_order(queued: QueuedDelivery) -> tuple[int, datetime, DeliveryId]:
    delivery = queued.delivery
    rank = PRIORITY_RANKS[delivery.request.qos.priority]
    return rank, delivery.created_at, delivery.delivery_id


def books_from(request: DeliveryRequest, horizon: timedelta) -> datetime | None:
    """The moment from which a drone may be booked, fleet time.

    None without an earliest pickup, and without windows that all open later.
    """
    first_at = request.first_hand_over_at
    return None if first_at is None else first_at - horizon


@dataclass(frozen=True, slots=True)
class ScheduleOpener:
    """Requests the SCHEDULED deliveries whose pickup has come within the horizon.

    A SCHEDULED delivery whose cancellation was begun and not ended is requested too: booking
    finishes the cancellation.
    """

    db: Database
    writer: DeliveryWriter
    clock: FleetClock
    queued: Wake
    horizon: timedelta

    async def step(self) -> bool:
        """One step of the loop; True when more deliveries may be due."""
        until = self.clock.now() + self.horizon
        async with self.db.read() as connection:
            found = await scheduled_until(connection, until, limit=_BATCH)
        for delivery_id in found:
            await self._request(delivery_id)
        return len(found) == _BATCH

    async def _request(self, delivery_id: DeliveryId) -> None:
        async with self.db.write() as tx:
            # Lock before the read: the customer may cancel it, or another replica request it.
            now = await delivery_store.lock(tx, delivery_id)
            if now.delivery.state != "SCHEDULED":
                return
            after = changed(now.delivery, state="REQUESTED", updated_at=self.clock.now())
            give_up = give_up_at(after.request, self.clock)
            self.writer.save(tx, now, Progress(after), give_up_at=give_up)
            tx.after_commit(self.queued.set)
