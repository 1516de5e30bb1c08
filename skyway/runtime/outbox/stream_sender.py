"""The loop that sends the outbox: the oldest row of every stream, one row at a time in each.

So the order holds within a stream, and a stream that is stuck holds up no other. Rows are claimed
for a while: several replicas share the work, and another replica sends the rows of a dead one.

Transactions that write to one stream must not run side by side, or a later row could be seen
first. They hold the lock of the mission or delivery that the stream is about.
"""

import asyncio
import heapq
import logging
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import Row, Table

from skyway.runtime.clock import FleetClock, sleep_wall
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.loops import Pace, Wake, always, repeat
from skyway.runtime.metrics import count
from skyway.runtime.minting import mint
from skyway.runtime.outbox.outbox_store import claim_due, delete_and_claim, delete_sent, free_row
from skyway.runtime.sql.claims import FREE, claim_values
from skyway.runtime.sql.database import Database
from skyway.runtime.tracing import tracing
from skyway.units import moment_to_ms

log = logging.getLogger(__name__)

#: How long a row is claimed, seconds of wall time: longer than any single send takes.
_LEASE_S: Final = 15.0
#: The longest time for which a sent row stays in the table, seconds: until then the next look may
#: delete it. If this process is killed meanwhile, the row is sent twice.
_DELETED_WITHIN_S: Final = 0.3
#: The most rows that are sent concurrently, each of another stream.
_MOST_UNDER_WAY: Final = 64
#: The longest time between two looks at the table, seconds: a replica may have died before it sent
#: what it had written or claimed. A sender may skip such looks while it does not poll.
_LONGEST_PAUSE_S: Final = 1.0
#: Rows that wait for longer than that are due at multiples of this, so that many are due together.
_TOGETHER_MS: Final = 500

#: Seconds of wall time from one look at the table to the next. All rows that were written or sent
#: meanwhile take one statement, and a row that comes after a quiet time waits for nothing.
_SOON_S: Final = 0.05
#: The same under load, after `_EARLY_LOOKS` looks at that pace.
_QUICK_S: Final = 0.1
_UNHURRIED_S: Final = 0.2
_HINTS_S: Final = 0.5
_EARLY_LOOKS: Final = 10


def quick_pace() -> Pace:
    """The pace for rows that somebody waits for."""
    return Pace(_QUICK_S, burst=_EARLY_LOOKS, least_s=_SOON_S)


def unhurried_pace() -> Pace:
    """The pace for all other rows: slow under load, fast when there is little to do."""
    return Pace(_UNHURRIED_S, burst=_EARLY_LOOKS, least_s=_SOON_S)


def hint_pace() -> Pace:
    """The pace for rows that are only hints: under load many of them leave together."""
    return Pace(_HINTS_S, burst=_EARLY_LOOKS, least_s=_SOON_S)


@dataclass(frozen=True, slots=True)
class Retry:
    """A row stays in the outbox and is sent again after a while of wall time."""

    after_s: float
    attempts: int


#: Sends one row; None when the row is done. Any: the columns of `outbox_table`.
Send = Callable[[Row[Any]], Awaitable[Retry | None]]


def retry_later(row: Row[Any], span_s: tuple[float, float]) -> Retry:
    """The retry of a row; the pause doubles with each attempt, from the first time to the last."""
    first_s, longest_s = span_s
    after_s = min(first_s * 2.0 ** min(row.attempts, 16), longest_s)
    return Retry(after_s=after_s, attempts=row.attempts + 1)


@dataclass(frozen=True, slots=True, order=True)
class _Waiting:
    """A row that is due again at a wall time; `store_at_ms` is when the table must know."""

    store_at_ms: int
    row_id: int
    attempts: int
    due_at_ms: int


async def no_wait() -> None:
    """Return immediately: sending needs nothing first."""


class StreamSender:
    """Sends the rows of one channel until cancelled; while it `polls`, it also looks unasked."""

    def __init__(
        self,
        db: Database,
        channel: str,
        send: Send,
        *,
        clock: FleetClock,
        pace: Pace,
        lease_s: float = _LEASE_S,
        ready: Callable[[], Awaitable[None]] = no_wait,
        polls: Callable[[], bool] = always,
    ) -> None:
        if db.outbox is None:
            raise RuntimeError("this database was opened without an outbox")
        self._db = db
        self._table: Table = db.outbox
        self._channel = channel
        self._send = send
        self._clock = clock
        self._lease_s = lease_s
        self._ready = ready
        self._polls = polls
        self._claimant = mint("snd")
        self._claims_are_free = False  # from the claims of the process that ran before
        self._wake = Wake()
        self._under_way: set[asyncio.Task[None]] = set()
        self._sent: list[int] = []  # rows that are sent, and still in the table
        self._looks = 0
        self._waiting: list[_Waiting] = []  # a heap
        self._pace = pace
        self._claim = claim_due(self._table, channel)
        self._delete = delete_sent(self._table)
        self._delete_and_claim = delete_and_claim(self._delete, self._claim.statement)
        self._free = free_row(self._table)

    async def run(self) -> None:
        """Send for ever."""
        self._db.wake_when_sent(self._wake, channel=self._channel)
        self._count_failures(0)
        try:
            async with asyncio.TaskGroup() as group:
                await repeat(
                    f"outbox {self._channel}", lambda: self._step(group), every_s=_LONGEST_PAUSE_S
                )
        finally:
            if self._sent:
                # Else the next rows of these streams would wait until our claims run out.
                with suppress(ServiceUnavailable):
                    await self._db.write_alone(self._delete, {"sent": self._sent})

    async def _free_all_claims(self) -> None:
        """A SQLite file has one process, so every earlier claimant is dead."""
        async with self._db.write() as tx:
            mine = self._table.c.channel == self._channel
            await tx.execute(self._table.update().where(mine).values(FREE))
        self._claims_are_free = True

    async def _step(self, group: asyncio.TaskGroup) -> bool:
        if self._db.dialect == "sqlite" and not self._claims_are_free:
            await self._free_all_claims()
        await self._ready()
        await self._pace.turn()
        rows = await self._next_rows()
        for row in rows:
            task = group.create_task(self._deliver(row, self._looks))
            self._under_way.add(task)
            task.add_done_callback(self._finished)
        await self._pause()
        return True

    def _finished(self, task: asyncio.Task[None]) -> None:
        was_full = len(self._under_way) == _MOST_UNDER_WAY
        self._under_way.discard(task)
        if was_full:
            self._wake.set()

    async def _next_rows(self) -> Sequence[Row[Any]]:
        """Delete the sent rows, free the rows that are due again, and claim the next ones.

        None of these depends on the others. A row that is not deleted or freed is ours until its
        claim runs out, and is sent again then.
        """
        await self._free_due()
        self._looks += 1
        sent, self._sent = self._sent, []
        values = claim_values(
            limit=_MOST_UNDER_WAY - len(self._under_way),
            claimant=self._claimant,
            lease_s=self._lease_s,
            clock=self._clock,
        )
        values["sent"] = sent
        try:
            if self._db.dialect == "postgresql":
                claimed = await self._db.write_alone(self._delete_and_claim, values)
            else:
                async with self._db.write() as tx:
                    await tx.execute(self._delete, values)
                    claimed = (await tx.execute(self._claim.statement, values)).all()
        except BaseException:
            self._sent = sent + self._sent
            raise
        return self._claim.in_order(claimed)

    async def _free_due(self) -> None:
        """Free the rows whose next due time the table must know now."""
        now_ms = self._now_ms()
        due: list[_Waiting] = []
        while self._waiting and self._waiting[0].store_at_ms <= now_ms:
            due.append(heapq.heappop(self._waiting))
        rows = [
            {"sent_id": each.row_id, "attempts": each.attempts, "due_at_ms": each.due_at_ms}
            for each in due
        ]
        if rows:
            await self._db.write_alone(self._free, rows)

    async def _pause(self) -> None:
        """Wait until a row is written, sent or due again, or until it is time to poll."""
        alarm = asyncio.create_task(self._wake_when_due())
        try:
            while not await self._wake.wait(_LONGEST_PAUSE_S) and not self._polls():
                pass
        finally:
            alarm.cancel()

    async def _wake_when_due(self) -> None:
        """Wake this loop when a row is due again, or when it is time to poll, by the clock."""
        while True:
            pause_s = _LONGEST_PAUSE_S
            if self._waiting:
                pause_s = min((self._waiting[0].store_at_ms - self._now_ms()) / 1000, pause_s)
            await sleep_wall(self._clock, pause_s)
            if self._has_due() or self._polls():
                self._wake.set()
                return

    def _has_due(self) -> bool:
        return bool(self._waiting) and self._waiting[0].store_at_ms <= self._now_ms()

    async def _deliver(self, row: Row[Any], look: int) -> None:
        """Send a row that a look has found, and remember the outcome.

        After any error its claim runs out.
        """
        try:
            with tracing(row.traceparent, f"send to {self._channel}"):
                retry = await self._send(row)
        except Exception:
            self._count_failures(1)
            log.exception("send failed", extra={"channel": self._channel, "stream": row.stream})
            return
        count("skyway_outbox_sends", "rows sent, repeats too", channel=self._channel)
        if retry is None:
            self._sent.append(row.id)
            # Another row may wait behind this one. A later look has passed that row over.
            if row.has_next or look < self._looks:
                self._wake.set()
            elif len(self._sent) == 1:
                asyncio.get_running_loop().call_later(_DELETED_WITHIN_S, self._wake_if_sent)
        else:
            self._keep(row, retry)

    def _wake_if_sent(self) -> None:
        if self._sent:
            self._wake.set()

    def _count_failures(self, failures: int) -> None:
        count("skyway_outbox_failures", "sends that broke", failures, channel=self._channel)

    def _keep(self, row: Row[Any], retry: Retry) -> None:
        """Remember a row that must be sent again later.

        Most rows are confirmed and deleted before that. While our claim lasts nobody else sends the
        row, so the table needs the due time only when the row is due. If the row waits for longer
        than the claim lasts, the table must know the due time now.
        """
        due_at_ms = self._now_ms() + int(retry.after_s * 1000)
        if retry.after_s > _LONGEST_PAUSE_S:
            due_at_ms = -(-due_at_ms // _TOGETHER_MS) * _TOGETHER_MS
        is_claimed = due_at_ms + _LONGEST_PAUSE_S * 1000 < row.claimed_until_ms
        store_at_ms = due_at_ms if is_claimed else 0
        heapq.heappush(self._waiting, _Waiting(store_at_ms, row.id, retry.attempts, due_at_ms))
        if not is_claimed or retry.after_s < _LONGEST_PAUSE_S:
            self._wake.set()

    def _now_ms(self) -> int:
        return moment_to_ms(self._clock.wall_now())
