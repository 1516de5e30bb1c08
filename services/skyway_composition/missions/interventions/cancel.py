"""Cancelling packages of a delivery: once, in one transaction over all its missions."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce

from skyway.contracts.mission import Cancellation, CancelMissions
from skyway.ids import DeliveryId, PackageId
from skyway.runtime.clock import FleetClock
from skyway.runtime.loops import Wake
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms
from skyway_composition.missions.interventions import store
from skyway_composition.missions.interventions.stop_packages import stop_packages
from skyway_composition.missions.mission.custody import has_never_left
from skyway_composition.missions.mission.custody_store import held_packages
from skyway_composition.missions.mission.store import lock_delivery
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork

#: Told of whatever a customer has cancelled.
CANCELLED = "CANCELLED"


@dataclass(frozen=True, slots=True)
class Cancellations:
    """Cancels what can be cancelled; `stuck` is woken after it."""

    db: Database
    clock: FleetClock
    mint: Mint
    stuck: Wake

    async def cancel(self, delivery_id: DeliveryId, wanted: CancelMissions) -> Cancellation:
        """What becomes of each package; the same cancellation again is answered the same.

        Locked in the order of everybody: the delivery, so that nothing is booked for it meanwhile,
        then drones and their missions.
        """
        async with self.db.write() as tx:
            await lock_delivery(tx, delivery_id)
            known = await store.cancellation(tx, delivery_id, wanted.cancellation_id)
            if known is not None:
                return known
            answer = await self._stop(tx, delivery_id, wanted)
            await store.add_cancellation(
                tx,
                delivery_id,
                wanted.cancellation_id,
                answer=answer,
                at_ms=moment_to_ms(self.clock.now()),
            )
            tx.after_commit(self.stuck.set)
            return answer

    async def _stop(self, tx: Tx, delivery_id: DeliveryId, wanted: CancelMissions) -> Cancellation:
        drone_ids = await store.drones_serving(tx.connection, delivery_id)
        work = await MissionUnitOfWork.lock(drone_ids, tx=tx, clock=self.clock, mint=self.mint)
        records = [
            work.missions[each]
            for each in drone_ids
            # Meanwhile the drone may serve somebody else.
            if each in work.missions and work.missions[each].mission.delivery_id == delivery_id
        ]
        held = await held_packages(tx.connection, delivery_id)
        under_way = {each.package_id for one in records for each in one.request.packages}
        package_ids = wanted.package_ids
        if package_ids is None:
            package_ids = tuple(sorted(under_way | held.keys()))
        stopped = [
            await stop_packages(work, record, package_ids, code=CANCELLED, reason=wanted.reason)
            for record in records
        ]
        # Of no live mission: never booked and free to go, or with somebody for good.
        others: dict[bool, list[PackageId]] = {True: [], False: []}
        for each in package_ids:
            if each not in under_way:
                others[has_never_left(held.get(each))].append(each)
        remainder = Cancellation(released=tuple(others[True]), too_late=tuple(others[False]))
        return _together([*stopped, remainder])


def _together(parts: Iterable[Cancellation]) -> Cancellation:
    return reduce(
        lambda one, other: Cancellation(
            released=one.released + other.released,
            returning=one.returning + other.returning,
            too_late=one.too_late + other.too_late,
        ),
        parts,
    )
