"""Mission reports become the delivery's progress: each applied once, in each mission's order."""

from dataclasses import dataclass

from skyway.contracts.mission import LIVE_MISSION_STATES, CancelMissions, MissionReport
from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database, Tx
from skyway.runtime.errors import Conflict
from skyway.runtime.loops import Wake
from skyway_gateway.clients import CANCELLATIONS_PATH
from skyway_gateway.deliveries import store
from skyway_gateway.deliveries.delivery import Delivery
from skyway_gateway.deliveries.patience import give_up_at
from skyway_gateway.deliveries.reports import after_report
from skyway_gateway.deliveries.writing import keep
from skyway_gateway.notifications.events import Events


@dataclass(frozen=True, slots=True)
class Follower:
    """Applies mission reports; `queued` is set when refused packages are to be booked anew."""

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
            if await store.take_report(tx, report):
                await self._apply(tx, delivery, report)
            else:
                await self._pass_over(tx, delivery, report)

    async def _pass_over(self, tx: Tx, delivery: Delivery, report: MissionReport) -> None:
        """Nothing to do for a report that was applied before; another one comes too early."""
        last = await store.last_report(tx, report.mission_id)
        if last is None:
            self._refuse_if_not_yet(delivery, report)
            _call_off(tx, delivery, report)
        elif report.seq > last:
            raise Conflict("NOT_YET", f"report {report.seq} comes before {last + 1}")

    def _refuse_if_not_yet(self, delivery: Delivery, report: MissionReport) -> None:
        """A mission that is still to be planned here is one of the attempt that is due."""
        if delivery.is_queued and report.attempt >= delivery.attempt:
            detail = f"mission {report.mission_id} of attempt {report.attempt} is not planned yet"
            raise Conflict("NOT_YET", detail)

    async def _apply(self, tx: Tx, delivery: Delivery, report: MissionReport) -> None:
        progress = after_report(delivery, report)
        await keep(tx, self.events, delivery, progress)
        if report.kind == "REFUSED" and progress.delivery.is_queued:
            # Its patience begins anew: the drone that refused has used some of it up.
            until = give_up_at(delivery.request, self.clock)
            await store.keep_queued(tx, delivery.delivery_id, until=until)
            tx.after_commit(self.queued.set)


def _call_off(tx: Tx, delivery: Delivery, report: MissionReport) -> None:
    """Have a mission that was booked too late not carry what was cancelled here meanwhile.

    Its booking had outlived the claim of whoever asked for it; nobody here waits for it.
    """
    cancelled = [one.package_id for one in delivery.packages if one.state == "CANCELLED"]
    if report.mission_state not in LIVE_MISSION_STATES or not cancelled:
        return
    body = CancelMissions(
        cancellation_id=f"late_{report.mission_id}",
        package_ids=tuple(cancelled),
        reason="it was booked after its packages had been cancelled",
    )
    path = CANCELLATIONS_PATH.format(delivery_id=delivery.delivery_id)
    tx.report("composition", path, body, stream=delivery.delivery_id)
