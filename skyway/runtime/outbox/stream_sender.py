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

from sqlalchemy import Row, Table

from skyway.runtime.clock import FleetClock, sleep_wall
from skyway.runtime.loops import Wake, repeat
from skyway.runtime.metrics import count
from skyway.runtime.minting import mint
from skyway.runtime.outbox.again import Again, Send
from skyway.runtime.outbox.statements import both, claiming, dropping, freeing
from skyway.runtime.pace import Pace
from skyway.runtime.sql.claims import FREE, claim_values
from skyway.runtime.sql.database import Database
from skyway.runtime.tracing import tracing
from skyway.units import moment_to_ms

log = logging.getLogger(__name__)

#: How long a row is claimed, seconds of wall time: longer than any single send takes.
_LEASE_S: Final = 15.0
#: Rows under way at once, each of another stream.
_MOST_UNDER_WAY: Final = 64
#: Longest look away from the table, seconds: another replica may have written to it.
_LONGEST_REST_S: Final = 1.0
#: Rows that wait for longer than that are due on whole multiples of this, many at a time.
_TOGETHER_MS: Final = 500


@dataclass(frozen=True, slots=True, order=True)
class _Staying:
    """A row that is due again at a wall time; until `noted_at_ms` only we know, who hold it."""

    noted_at_ms: int
    row_id: int
    attempts: int
    due_at_ms: int


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
        pace: Pace,
        lease_s: float = _LEASE_S,
        ready: Callable[[], Awaitable[None]] = _at_once,
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
        self._claimant = mint("snd")
        self._wake = Wake()
        self._under_way: set[asyncio.Task[None]] = set()
        self._done: list[int] = []  # rows that are sent, and still in the table
        self._staying: list[_Staying] = []  # a heap
        self._pace = pace
        self._claiming = claiming(self._table, channel)
        self._dropping = dropping(self._table)
        self._turning = both(self._dropping, self._claiming.statement)
        self._freeing = freeing(self._table)

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
        was_full = len(self._under_way) == _MOST_UNDER_WAY
        self._under_way.discard(task)
        if self._done or was_full:
            self._wake.set()

    async def _turn(self) -> Sequence[Row[Any]]:
        """Delete what was sent, free what is due again, and claim what comes next.

        None of it needs the others: a row that is not deleted or freed is claimed by us until its
        claim runs out, and then sent again.
        """
        await self._free_due()
        done, self._done = self._done, []
        values = claim_values(
            limit=_MOST_UNDER_WAY - len(self._under_way),
            claimant=self._claimant,
            lease_s=self._lease_s,
            clock=self._clock,
        )
        values["done"] = done
        try:
            if self._db.dialect == "postgresql":
                taken = await self._db.write_alone(self._turning, values)
            else:
                async with self._db.write() as tx:
                    await tx.execute(self._dropping, values)
                    taken = (await tx.execute(self._claiming.statement, values)).all()
        except BaseException:
            self._done = done + self._done
            raise
        return self._claiming.in_order(taken)

    async def _free_due(self) -> None:
        """Free the rows of which the table must know by now when they are due again."""
        now_ms = self._now_ms()
        noted: list[_Staying] = []
        while self._staying and self._staying[0].noted_at_ms <= now_ms:
            noted.append(heapq.heappop(self._staying))
        rows = [
            {"sent_id": each.row_id, "attempts": each.attempts, "due_at_ms": each.due_at_ms}
            for each in noted
        ]
        if rows:
            await self._db.write_alone(self._freeing, rows)

    async def _rest(self) -> None:
        """Wait until something is written, sent or due again, but no longer than a while."""
        rest_s = _LONGEST_REST_S
        if self._staying:
            rest_s = min((self._staying[0].noted_at_ms - self._now_ms()) / 1000, rest_s)
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
            self._done.append(row.id)
        else:
            self._keep(row, again)

    def _keep(self, row: Row[Any], again: Again) -> None:
        """Remember a row that stays; the table need not know before it is due again.

        Most are confirmed before that, and gone. While we hold a row nobody else sends it, so the
        table must know at once when it waits for longer than that.
        """
        due_at_ms = self._now_ms() + int(again.after_s * 1000)
        if again.after_s > _LONGEST_REST_S:
            due_at_ms = -(-due_at_ms // _TOGETHER_MS) * _TOGETHER_MS
        is_held = due_at_ms + _LONGEST_REST_S * 1000 < row.claimed_until_ms
        noted_at_ms = due_at_ms if is_held else 0
        heapq.heappush(self._staying, _Staying(noted_at_ms, row.id, again.attempts, due_at_ms))
        if not is_held or again.after_s < _LONGEST_REST_S:
            self._wake.set()

    def _now_ms(self) -> int:
        return moment_to_ms(self._clock.wall_now())
