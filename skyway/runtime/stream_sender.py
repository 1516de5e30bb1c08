"""The loop behind the outbox: the oldest row of every stream, at most one under way in each.

So order holds within a stream, and a stream that is stuck holds nobody else. Rows are claimed for
a while: several replicas share the work, and what a dead one held is sent by another.

Writers of one stream must not run side by side, or a later row could be seen first: they hold the
lock of the mission or delivery that the stream is about.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import ColumnElement, Row, Table, and_, bindparam, case, exists, func, select

from skyway.runtime.among import among
from skyway.runtime.claims import FREE, NOW_MS, Claiming
from skyway.runtime.clock import FleetClock, sleep_wall
from skyway.runtime.database import Database, Tx
from skyway.runtime.loops import Wake, repeat
from skyway.runtime.metrics import count
from skyway.runtime.minting import mint
from skyway.runtime.tracing import tracing
from skyway.units import moment_to_ms

log = logging.getLogger(__name__)

#: Longer than any single send takes, seconds of wall time.
_LEASE_S: Final = 15.0
#: Rows under way at once, each of another stream.
_MOST_UNDER_WAY: Final = 64
#: Longest look away from the table, seconds: another replica may have written to it.
_LONGEST_REST_S: Final = 1.0


@dataclass(frozen=True, slots=True)
class Again:
    """A row stays, and is sent again after a while of wall time."""

    after_s: float
    attempts: int


#: Sends one row; None when it is done with. Any: the columns of `outbox_table`.
Send = Callable[[Row[Any]], Awaitable[Again | None]]


@dataclass(frozen=True, slots=True)
class _Sent:
    """The outcome of sending a row, at a moment of wall time; it is to be noted yet."""

    row_id: int
    at_ms: int
    again: Again | None


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
        columns = self._table.c
        is_next = _is_next(self._table, channel)
        self._claiming = Claiming.of(
            self._table, where=and_(is_next, columns.due_at_ms <= NOW_MS), order_by=[columns.id]
        )
        later = case(
            (columns.due_at_ms > columns.claimed_until_ms, columns.due_at_ms),
            else_=columns.claimed_until_ms,
        )
        self._earliest = select(func.min(later)).where(is_next)
        self._done = self._table.delete().where(among(columns.id, "done"))
        self._stays = self._table.update().where(columns.id == bindparam("sent_id")).values(FREE)

    async def run(self) -> None:
        """Send for ever."""
        self._db.wake_when_sent(self._wake)
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
        rows, rest_s = await self._turn()
        for row in rows:
            task = group.create_task(self._deliver(row))
            self._under_way.add(task)
            task.add_done_callback(self._finished)
        if rest_s > 0:
            await self._rest(rest_s)
        return True

    def _finished(self, task: asyncio.Task[None]) -> None:
        self._under_way.discard(task)
        self._wake.set()

    async def _turn(self) -> tuple[Sequence[Row[Any]], float]:
        """Note what was sent and claim what comes next, in one transaction.

        Also the seconds of wall time until there may be more to send.
        """
        sent, self._sent = self._sent, []
        free = _MOST_UNDER_WAY - len(self._under_way)
        try:
            async with self._db.write() as tx:
                await self._settle(tx, sent)
                if free == 0:
                    return [], _LONGEST_REST_S
                rows = await self._claiming.run(
                    tx, limit=free, claimant=self._claimant, lease_s=_LEASE_S, clock=self._clock
                )
                return rows, 0.0 if len(rows) == free else await self._rest_s(tx)
        except BaseException:
            self._sent = sent + self._sent
            raise

    async def _rest_s(self, tx: Tx) -> float:
        """Seconds of wall time until a row can be sent; 0 when one can be now."""
        due_ms: int | None = (await tx.execute(self._earliest)).scalar()
        if due_ms is None:
            return _LONGEST_REST_S
        return min(max(due_ms - self._now_ms(), 0) / 1000, _LONGEST_REST_S)

    async def _rest(self, duration_s: float) -> None:
        """Wait until something is sent or finished, or the clock has moved on."""
        alarm = asyncio.create_task(self._wake_after(duration_s))
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
        self._sent.append(_Sent(row.id, self._now_ms(), again))

    async def _settle(self, tx: Tx, sent: Sequence[_Sent]) -> None:
        """Delete the rows that are done with, and free the others until they are due again."""
        done = [each.row_id for each in sent if each.again is None]
        if done:
            await tx.execute(self._done, {"done": done})
        stays = [
            {
                "sent_id": each.row_id,
                "attempts": each.again.attempts,
                "due_at_ms": each.at_ms + int(each.again.after_s * 1000),
            }
            for each in sent
            if each.again is not None
        ]
        if stays:
            await tx.execute(self._stays, stays)

    def _now_ms(self) -> int:
        return moment_to_ms(self._clock.wall_now())


def _is_next(table: Table, channel: str) -> ColumnElement[bool]:
    """Whether a row is the oldest of its stream on this channel."""
    columns, older = table.c, table.alias("older")
    has_older = exists().where(
        older.c.channel == columns.channel,
        older.c.stream == columns.stream,
        older.c.id < columns.id,
    )
    return and_(columns.channel == channel, ~has_older)
