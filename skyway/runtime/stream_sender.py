"""The loop behind the outbox: the oldest row of every stream, at most one under way in each.

So order holds within a stream, and a stream that is stuck holds nobody else. Rows are claimed for
a while: several replicas share the work, and what a dead one held is sent by another.

Writers of one stream must not run side by side, or a later row could be seen first: they hold the
lock of the mission or delivery that the stream is about.
"""

import asyncio
import heapq
import logging
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import ColumnElement, Row, Table, Update, and_, bindparam, exists, select

from skyway.runtime.among import among
from skyway.runtime.claims import FREE, NOW_MS, Claiming
from skyway.runtime.clock import FleetClock, sleep_wall
from skyway.runtime.database import Database, Tx
from skyway.runtime.loops import Wake, repeat
from skyway.runtime.metrics import count
from skyway.runtime.minting import mint
from skyway.runtime.pace import Pace
from skyway.runtime.tracing import tracing
from skyway.units import moment_to_ms

log = logging.getLogger(__name__)

#: Longer than any single send takes, seconds of wall time.
_LEASE_S: Final = 15.0
#: Rows under way at once, each of another stream.
_MOST_UNDER_WAY: Final = 64
#: Longest look away from the table, seconds: another replica may have written to it.
_LONGEST_REST_S: Final = 1.0
#: Seconds of wall time from one look at the table to the next: what is written and sent meanwhile
#: takes one transaction, and a row that comes after a while of silence waits for nothing.
_PAUSE_S: Final = 0.05


@dataclass(frozen=True, slots=True)
class Again:
    """A row stays, and is sent again after a while of wall time."""

    after_s: float
    attempts: int


#: Sends one row; None when it is done with. Any: the columns of `outbox_table`.
Send = Callable[[Row[Any]], Awaitable[Again | None]]


@dataclass(frozen=True, slots=True)
class _Sent:
    """A row that was sent, to be noted yet: it is done with, or due again at a wall time."""

    row_id: int
    attempts: int
    due_at_ms: int | None


async def _at_once() -> None:
    """Nothing to wait for before sending."""


class StreamSender:
    """Sends the rows of one channel until cancelled."""

    def __init__(
        self,
        db: Database,
        channel: str,
        send: Send,
        *,
        clock: FleetClock,
        ready: Callable[[], Awaitable[None]] = _at_once,
    ) -> None:
        if db.outbox is None:
            raise RuntimeError("this database was opened without an outbox")
        self._db = db
        self._table: Table = db.outbox
        self._channel = channel
        self._send = send
        self._clock = clock
        self._ready = ready
        self._claimant = mint("snd")
        self._wake = Wake()
        self._under_way: set[asyncio.Task[None]] = set()
        self._sent: list[_Sent] = []
        self._due_at_ms: list[int] = []  # a heap of when rows that we have sent are due again
        self._pace = Pace(_PAUSE_S)
        columns = self._table.c
        is_next = _is_next(self._table, channel)
        self._claiming = Claiming.of(
            self._table, where=and_(is_next, columns.due_at_ms <= NOW_MS), order_by=[columns.id]
        )
        self._done = self._table.delete().where(among(columns.id, "done"))
        self._stays = _keeping(self._table)

    async def run(self) -> None:
        """Send for ever."""
        self._db.wake_when_sent(self._wake, channel=self._channel)
        if self._db.dialect == "sqlite":
            await self._free_claims()
        async with asyncio.TaskGroup() as group:
            await repeat(
                f"outbox {self._channel}", lambda: self._step(group), every_s=_LONGEST_REST_S
            )

    async def _free_claims(self) -> None:
        """A SQLite file has one process: whoever claimed before us is dead."""
        async with self._db.write() as tx:
            mine = self._table.c.channel == self._channel
            await tx.execute(self._table.update().where(mine).values(FREE))

    async def _step(self, group: asyncio.TaskGroup) -> bool:
        await self._ready()
        await self._pace.turn()
        rows = await self._turn()
        for row in rows:
            task = group.create_task(self._deliver(row))
            self._under_way.add(task)
            task.add_done_callback(self._finished)
        await self._rest()
        return True

    def _finished(self, task: asyncio.Task[None]) -> None:
        self._under_way.discard(task)
        self._wake.set()

    async def _turn(self) -> Sequence[Row[Any]]:
        """Note what was sent and claim what comes next, in one transaction."""
        sent, self._sent = self._sent, []
        free = _MOST_UNDER_WAY - len(self._under_way)
        while self._due_at_ms and self._due_at_ms[0] <= self._now_ms():
            heapq.heappop(self._due_at_ms)
        try:
            async with self._db.write() as tx:
                await self._settle(tx, sent)
                if free == 0:
                    return []
                return await self._claiming.run(
                    tx, limit=free, claimant=self._claimant, lease_s=_LEASE_S, clock=self._clock
                )
        except BaseException:
            self._sent = sent + self._sent
            raise

    async def _rest(self) -> None:
        """Wait until something is written, finished or due again, but no longer than a while."""
        rest_s = _LONGEST_REST_S
        if self._due_at_ms:
            rest_s = min((self._due_at_ms[0] - self._now_ms()) / 1000, rest_s)
        alarm = asyncio.create_task(self._wake_after(rest_s))
        try:
            await self._wake.wait(_LONGEST_REST_S)
        finally:
            alarm.cancel()

    async def _wake_after(self, duration_s: float) -> None:
        await sleep_wall(self._clock, duration_s)
        self._wake.set()

    async def _deliver(self, row: Row[Any]) -> None:
        """Send one row and keep the outcome; whatever goes wrong, its claim runs out."""
        try:
            with tracing(row.traceparent):
                again = await self._send(row)
        except Exception:
            count("skyway_outbox_failures", "sends that broke", channel=self._channel)
            log.exception("send failed", extra={"channel": self._channel, "stream": row.stream})
            return
        count("skyway_outbox_sends", "rows sent, repeats too", channel=self._channel)
        if again is None:
            self._sent.append(_Sent(row.id, row.attempts, None))
            return
        due_at_ms = self._now_ms() + int(again.after_s * 1000)
        self._sent.append(_Sent(row.id, again.attempts, due_at_ms))
        heapq.heappush(self._due_at_ms, due_at_ms)

    async def _settle(self, tx: Tx, sent: Sequence[_Sent]) -> None:
        """Delete the rows that are done with, and free the others until they are due again."""
        done = [each.row_id for each in sent if each.due_at_ms is None]
        if done:
            await tx.execute(self._done, {"done": done})
        stays = [
            {"sent_id": each.row_id, "attempts": each.attempts, "due_at_ms": each.due_at_ms}
            for each in sent
            if each.due_at_ms is not None
        ]
        if stays:
            await tx.execute(self._stays, stays)

    def _now_ms(self) -> int:
        return moment_to_ms(self._clock.wall_now())


def _keeping(table: Table) -> Update:
    """Free the row `sent_id`, unless somebody is at it: then it is being confirmed.

    Who confirms several rows holds one while it waits for the next: waiting for that one here, with
    the next in hand, would never end. A row that stays after all is free when its claim runs out.
    """
    row, this = table.alias("row_sent"), bindparam("sent_id", type_=table.c.id.type)
    untouched = select(row.c.id).where(row.c.id == this).with_for_update(skip_locked=True)
    return table.update().where(table.c.id == this, table.c.id.in_(untouched)).values(FREE)


def _is_next(table: Table, channel: str) -> ColumnElement[bool]:
    """Whether a row is the oldest of its stream on this channel."""
    columns, older = table.c, table.alias("older")
    has_older = exists().where(
        older.c.channel == columns.channel,
        older.c.stream == columns.stream,
        older.c.id < columns.id,
    )
    return and_(columns.channel == channel, ~has_older)
