"""Withdraws the bookings of a delivery whose request changes, before a drone is sent."""

from dataclasses import dataclass

from skyway.contracts.mission import WithdrawMissions
from skyway.ids import DeliveryId
from skyway.runtime.errors import Conflict, RowRefused
from skyway.runtime.sql.database import Tx
from skyway.units import NEVER_MS
from skyway_composition.calendar.attempts import Change, Lost, carry_out
from skyway_composition.context import Context
from skyway_composition.missions.mission import end, store
from skyway_composition.missions.mission.record import Trouble
from skyway_composition.missions.mission.unit_of_work import lock_missions


async def withdraw_missions(
    context: Context, delivery_id: DeliveryId, requested: WithdrawMissions
) -> None:
    """Give up the QUEUED missions of a delivery, and book its attempts up to this one no more.

    A repeated call changes nothing. Each mission is reported as REFUSED, code CHANGED.

    Raises
    ------
    Conflict
        TOO_LATE: a drone has the mission already, or it was flown. SHARED_TRIP: a mission also
        carries packages of other deliveries. Nothing is given up.
    """
    await carry_out(context, _Withdraw(context, delivery_id, requested.attempt))


@dataclass(frozen=True, slots=True)
class _Withdraw:
    """The cause that takes QUEUED missions out of calendars; it plans nothing."""

    context: Context
    delivery_id: DeliveryId
    attempt: int

    async def propose(self, lost: Lost | None) -> Change[None]:
        """The withdrawal, again if the dispatcher has moved a mission to another drone."""
        if isinstance(lost, RowRefused):
            raise lost
        return Change(NEVER_MS, self._write)

    async def _write(self, tx: Tx) -> None:
        # The order of locks is that of a cancellation.
        delivery = await store.lock_delivery(tx, self.delivery_id)
        work, flying, queued = await lock_missions(self.context, tx, self.delivery_id)
        ended = await store.missions_not_refused(tx.connection, self.delivery_id)
        _require_free(
            is_sent=bool(flying) or len(ended) > len(queued),
            is_shared=any(record.shares for record in queued),
        )
        why = Trouble(code="CHANGED", detail="the customer has changed the request")
        for record in queued:
            await end.refuse(work, record, why)
        until = max(self.attempt, delivery.withdrawn_attempt)
        await store.withdraw_attempts(tx, self.delivery_id, until=until)
        tx.after_commit(self.context.stuck.set)


def _require_free(*, is_sent: bool, is_shared: bool) -> None:
    if is_sent:
        detail = "a drone has its mission already: cancel the delivery, and request another one"
        raise Conflict("TOO_LATE", detail)
    if is_shared:
        detail = "its drone also carries packages of other deliveries, which count on this trip"
        raise Conflict("SHARED_TRIP", detail)
