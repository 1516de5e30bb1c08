"""Mission reports become the delivery's progress: each applied once, in each mission's order."""

from dataclasses import dataclass

from skyway.contracts.mission import MissionReport
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database, Tx
from skyway.runtime.errors import Conflict
from skyway.runtime.loops import Wake
from skyway_gateway.deliveries import store
from skyway_gateway.deliveries.delivery import Delivery
from skyway_gateway.deliveries.patience import give_up_at
from skyway_gateway.deliveries.progress import after_report
from skyway_gateway.notifications.events import Events


@dataclass(frozen=True, slots=True)
class Follower:
    """Applies mission reports; `queued` is set when a refused delivery is to be booked anew."""

    db: Database
    events: Events
    clock: FleetClock
    queued: Wake

    async def follow(self, report: MissionReport) -> None:
        """Apply a report; one that was applied before changes nothing.

        Raises
        ------
        NotFound
            The delivery is none of ours: the report can be dropped.
        Conflict
            NOT_YET: what comes before it is not known here; the sender repeats it.
        """
        async with self.db.write() as tx:
            # The lock comes first: two replicas may be told of the same mission at once.
            delivery = await store.lock(tx, report.delivery_id)
            if await self._is_next(tx, delivery, report):
                await self._apply(tx, delivery, report)

    async def _is_next(self, tx: Tx, delivery: Delivery, report: MissionReport) -> bool:
        """Whether it is new and its turn; a report that was applied before is not new."""
        mission = await store.reported_mission(tx, report.mission_id)
        if mission is None:
            if delivery.is_over or report.attempt < delivery.attempt:
                return False  # never planned here, and never will be
            detail = f"mission {report.mission_id} of attempt {report.attempt} is not planned yet"
            raise Conflict("NOT_YET", detail)
        if report.seq > mission.report_seq + 1:
            detail = f"report {report.seq} comes before {mission.report_seq + 1}"
            raise Conflict("NOT_YET", detail)
        return report.seq == mission.report_seq + 1

    async def _apply(self, tx: Tx, delivery: Delivery, report: MissionReport) -> None:
        progress = after_report(delivery, report)
        if progress.delivery != delivery:
            await store.save(tx, delivery, progress.delivery)
        await store.note_report(tx, report)
        await self.events.tell(
            tx,
            progress.happenings,
            delivery_id=delivery.delivery_id,
            customer_id=delivery.customer_id,
        )
        if progress.delivery.state == "REQUESTED":
            # Its patience begins anew: the drone that refused has used some of it up.
            until = give_up_at(delivery.request, self.clock)
            await store.keep_queued(tx, delivery.delivery_id, until=until)
            tx.after_commit(self.queued.set)
