"""Mission reports become the delivery's progress: each applied once, in each mission's order."""

from collections.abc import Sequence
from dataclasses import dataclass

from skyway.contracts.mission import LIVE_MISSION_STATES, CancelMissions, MissionReport
from skyway.contracts.mission_reports import TracedReport
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict
from skyway.runtime.loops import Wake
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.tracing import tracing
from skyway_gateway.clients import CANCELLATIONS_PATH
from skyway_gateway.deliveries.lifecycle.booking_deadline import give_up_at
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.report_effects import after_report
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.deliveries.records.stored_delivery import Known, Outdated
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter


@dataclass(frozen=True, slots=True)
class Follower:
    """Applies mission reports; `queued` is set when refused packages are to be booked anew."""

    db: Database
    writer: DeliveryWriter
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
        if not await self._follow_known(report):
            await self._follow_locked(report)

    async def follow_all(self, reports: Sequence[TracedReport]) -> None:
        """Apply reports, each on its own: as a rule that is one statement without BEGIN and COMMIT.

        Raises
        ------
        NotFound, Conflict
            As of `follow`; those before the report that is refused are applied.
        """
        for each in reports:
            with tracing(each.traceparent):
                await self.follow(each.report)

    async def _follow_known(self, report: MissionReport) -> bool:
        """Apply a report to a delivery that is as we wrote it last; False when it is not."""
        known = self.writer.known.take(report.delivery_id)
        if known is None:
            return False
        try:
            async with self.db.write() as tx:
                self._apply(tx, known, report)
        except Outdated:
            return False
        return True

    async def _follow_locked(self, report: MissionReport) -> None:
        async with self.db.write() as tx:
            # The lock comes first: two replicas may be told of the same mission at once.
            now = await delivery_store.lock(tx, report.delivery_id)
            last = await delivery_store.last_report(tx, report.mission_id)
            if last is None:
                self._refuse_if_not_yet(now.delivery, report)
                _call_off(tx, now.delivery, report)
            elif report.seq > last + 1:
                raise Conflict("NOT_YET", f"report {report.seq} comes before {last + 1}")
            elif report.seq == last + 1:
                self._apply(tx, now, report)

    def _refuse_if_not_yet(self, delivery: Delivery, report: MissionReport) -> None:
        """A mission that is still to be planned here is one of the attempt that is due."""
        if delivery.is_queued and report.attempt >= delivery.attempt:
            detail = f"mission {report.mission_id} of attempt {report.attempt} is not planned yet"
            raise Conflict("NOT_YET", detail)

    def _apply(self, tx: Tx, known: Known, report: MissionReport) -> None:
        progress = after_report(known.delivery, report)
        give_up = None
        if report.kind == "REFUSED" and progress.delivery.is_queued:
            # Its patience begins anew: the drone that refused has used some of it up.
            give_up = give_up_at(known.delivery.request, self.clock)
            tx.after_commit(self.queued.set)
        self.writer.keep(tx, known, progress, report=report, give_up_at=give_up)


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
