"""How many deliveries a customer may have: those that are not over, and of these the SCHEDULED.

They are counted in the transaction that adds one, but not each time: a customer who was counted far
below the limits may add a quarter of the room that is left before the next count. So an honest
customer is hardly ever counted, and up to four replicas of the gateway together keep to the limits.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from sqlalchemy import bindparam, func, select, text
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import SubjectId, is_live_account
from skyway.runtime.errors import Conflict
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.database import Database, Tx
from skyway_gateway.access.usage import UsageQuota
from skyway_gateway.delivery_tables import IS_LIVE, deliveries

#: A customer without room is counted again after so long, seconds of wall time.
_FULL_FOR_S: Final = 1.0
_MOST_REMEMBERED: Final = 10_000
#: The part of the room that may be used before the next count.
_PART: Final = 4

_COUNT: Final = (
    select(
        func.count().label("live"),
        func.count().filter(deliveries.c.state == "SCHEDULED").label("scheduled"),
    )
    .select_from(deliveries)
    .where(deliveries.c.customer_id == bindparam("customer_id"), text(IS_LIVE))
)


@dataclass(frozen=True, slots=True)
class DeliveryLimits:
    """How many deliveries a customer may have that are not over, and of these SCHEDULED."""

    live: int
    scheduled: int


#: The most of a test account: a test delivery lasts seconds, and one player plays all of them.
_OF_TEST_ACCOUNT: Final = DeliveryLimits(live=100, scheduled=20)


@dataclass(slots=True)
class _Room:
    """What a customer may add before the next count."""

    live: int
    scheduled: int
    #: Until when the customer need not be counted again, because there was no room; else 0.
    live_full_until_s: float = 0.0
    scheduled_full_until_s: float = 0.0


class DeliveryQuota:
    """Refuses deliveries beyond the limits of their customer."""

    def __init__(
        self, db: Database, limits: DeliveryLimits, *, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._db = db
        self._limits = limits
        self._now = now
        self._rooms: dict[SubjectId, _Room] = {}

    async def admit(self, tx: Tx, customer_id: SubjectId, *, is_scheduled: bool) -> None:
        """Admit a delivery that this transaction adds.

        Raises
        ------
        Conflict
            TOO_MANY_DELIVERIES, TOO_MANY_SCHEDULED: the customer has as many as it may have.
        """
        room = self._rooms.get(customer_id) or _Room(0, 0)
        limits = self._limits_of(customer_id)
        _refuse_full(room, limits, now_s=self._now(), is_scheduled=is_scheduled)
        if room.live < 1 or (is_scheduled and room.scheduled < 1):
            room = await self._counted(tx, customer_id)
            self._remember(customer_id, room)
            _refuse_full(room, limits, now_s=self._now(), is_scheduled=is_scheduled)
        room.live -= 1
        room.scheduled -= is_scheduled

    async def usage(self, caller: Caller) -> Sequence[UsageQuota]:
        """What the caller has."""
        if caller.role not in ("customer", "operator"):
            return ()
        async with self._db.read() as connection:
            customer_id = SubjectId(caller.subject_id)
            live, scheduled = await _count(connection, customer_id)
        limits = self._limits_of(customer_id)
        return (
            UsageQuota(code="TOO_MANY_DELIVERIES", most=limits.live, used=live),
            UsageQuota(code="TOO_MANY_SCHEDULED", most=limits.scheduled, used=scheduled),
        )

    async def _counted(self, tx: Tx, customer_id: SubjectId) -> _Room:
        live, scheduled = await _count(tx.connection, customer_id)
        limits = self._limits_of(customer_id)
        live_left, scheduled_left = limits.live - live, limits.scheduled - scheduled
        full_until_s = self._now() + _FULL_FOR_S
        return _Room(
            live=-(-live_left // _PART),
            scheduled=-(-scheduled_left // _PART),
            live_full_until_s=0.0 if live_left > 0 else full_until_s,
            scheduled_full_until_s=0.0 if scheduled_left > 0 else full_until_s,
        )

    def _limits_of(self, customer_id: SubjectId) -> DeliveryLimits:
        own, tests = self._limits, _OF_TEST_ACCOUNT
        if is_live_account(customer_id):
            return own
        return DeliveryLimits(min(own.live, tests.live), min(own.scheduled, tests.scheduled))

    def _remember(self, customer_id: SubjectId, room: _Room) -> None:
        self._rooms.pop(customer_id, None)
        self._rooms[customer_id] = room
        if len(self._rooms) > _MOST_REMEMBERED:
            del self._rooms[next(iter(self._rooms))]


def _refuse_full(room: _Room, limits: DeliveryLimits, *, now_s: float, is_scheduled: bool) -> None:
    if now_s < room.live_full_until_s:
        detail = f"the limit is {limits.live} deliveries that are not over"
        raise Conflict("TOO_MANY_DELIVERIES", detail)
    if is_scheduled and now_s < room.scheduled_full_until_s:
        raise Conflict("TOO_MANY_SCHEDULED", f"the limit is {limits.scheduled} deliveries")


async def _count(connection: AsyncConnection, customer_id: SubjectId) -> tuple[int, int]:
    row = (await connection.execute(_COUNT, {"customer_id": customer_id})).one()
    return row.live, row.scheduled
