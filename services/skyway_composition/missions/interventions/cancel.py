"""Cancels packages of a delivery, in one transaction over all its missions."""

import logging
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial, reduce

from skyway.contracts.mission import Cancellation, CancelMissions
from skyway.ids import DeliveryId, PackageId
from skyway.runtime.errors import RowRefused
from skyway.runtime.sql.database import Tx
from skyway.units import NEVER_MS
from skyway_composition.calendar.attempts import Change, Lost, carry_out
from skyway_composition.context import Context
from skyway_composition.missions.interventions.stop_packages import release_queued, stop_packages
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.custody_store import has_never_left, held_packages
from skyway_composition.missions.mission.record import Trouble
from skyway_composition.missions.mission.share_views import flying_ids, own_ids
from skyway_composition.missions.mission.store import lock_delivery
from skyway_composition.missions.mission.unit_of_work import lock_missions

#: The code in reports about packages that a customer has cancelled.
CANCELLED = "CANCELLED"

log = logging.getLogger(__name__)


async def cancel_packages(
    context: Context, delivery_id: DeliveryId, requested: CancelMissions
) -> Cancellation:
    """Cancel what can be cancelled; returns what becomes of each package, and wakes `stuck`.

    A repeated request gets the same answer. The order of locks is the usual one: the delivery (so
    that nothing is booked for it meanwhile), the drones, their missions.
    """
    return await carry_out(context, _Stop(context, delivery_id, requested))


@dataclass(frozen=True, slots=True)
class _Stop:
    """The cause that stops packages of a delivery; it plans nothing."""

    context: Context
    delivery_id: DeliveryId
    requested: CancelMissions

    async def propose(self, lost: Lost | None) -> Change[Cancellation]:
        """The cancellation, again if the dispatcher has moved a mission to another drone."""
        if isinstance(lost, RowRefused):
            raise lost
        if lost is not None:
            log.info("waiting mission moved", extra={"delivery_id": self.delivery_id})
        return Change(NEVER_MS, self._write)

    async def _write(self, tx: Tx) -> Cancellation:
        delivery_id, requested = self.delivery_id, self.requested
        await lock_delivery(tx, delivery_id)
        earlier = await store.cancellation(tx, delivery_id, requested.cancellation_id)
        if earlier is not None:
            return earlier
        answer = await self._stop(tx, delivery_id, requested)
        await store.add_cancellation(
            tx,
            delivery_id,
            requested.cancellation_id,
            answer=answer,
            at_ms=self.context.now_ms,
        )
        tx.after_commit(self.context.stuck.set)
        return answer

    async def _stop(
        self, tx: Tx, delivery_id: DeliveryId, requested: CancelMissions
    ) -> Cancellation:
        work, records, queued = await lock_missions(self.context, tx, delivery_id)
        held = await held_packages(tx.connection, delivery_id)
        under_way: set[PackageId] = set()
        for record in (*records, *queued):
            ids = [*record.left_out, *(each.package_id for each in record.request.packages)]
            under_way.update(own_ids(record, delivery_id, ids))
        package_ids = requested.package_ids
        if package_ids is None:
            package_ids = tuple(sorted(under_way | held.keys()))
        stopped, why = [], Trouble(code=CANCELLED, detail=requested.reason)
        for record in records:
            flown_ids = flying_ids(record, delivery_id, package_ids)
            done = await stop_packages(work, record, flown_ids, why)
            own = partial(own_ids, record, delivery_id)
            stopped.append(
                Cancellation(
                    released=own(done.released),
                    returning=own(done.returning),
                    too_late=own(done.too_late),
                )
            )
        for record in queued:
            flown_ids = flying_ids(record, delivery_id, package_ids)
            released = await release_queued(work, record, flown_ids, why)
            stopped.append(Cancellation(released=own_ids(record, delivery_id, released)))
        # Packages without a live mission: never left the pickup (True), or too late (False).
        others: dict[bool, list[PackageId]] = {True: [], False: []}
        for each in package_ids:
            if each not in under_way:
                others[has_never_left(held.get(each))].append(each)
        without_mission = Cancellation(released=tuple(others[True]), too_late=tuple(others[False]))
        return _together([*stopped, without_mission])


def _together(parts: Iterable[Cancellation]) -> Cancellation:
    return reduce(
        lambda one, other: Cancellation(
            released=one.released + other.released,
            returning=one.returning + other.returning,
            too_late=one.too_late + other.too_late,
        ),
        parts,
    )
