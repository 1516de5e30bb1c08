"""Applies the mission reports that composition sends: each once, in the order of its mission.

A delivery whose reports do not arrive is marked late by `OverdueNotifier`.
"""

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from datetime import timedelta
from functools import partial
from typing import Final

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.contracts.mission_reports import (
    MissionReport,
    TracedReport,
)
from skyway.ids import DeliveryId, StationId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict, NotFound
from skyway.runtime.loops import Wake
from skyway.runtime.sql.database import Database, Tx
from skyway.runtime.tracing import in_trace_of, tracing
from skyway_gateway.deliveries.lifecycle.booking_effects import give_up_again_at
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.package_changes import TOLERANCE_S, when_overdue
from skyway_gateway.deliveries.lifecycle.progress import Progress
from skyway_gateway.deliveries.lifecycle.report_effects import after_report
from skyway_gateway.deliveries.records import delivery_store
from skyway_gateway.deliveries.records.delivery_rows import Outdated, StoredDelivery
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter, report_cancellation
from skyway_gateway.lateness.lateness_forecast import host_delay

#: Reports after which a drone or pads may be free again.
_FREEING: Final = ("REFUSED", "RELEASED", "ENDED")

#: Reports after which proofs are read or stored: under the delivery's lock, as all proofs are.
_ABOUT_PROOFS: Final = ("PROOF_AWAITED", "PIN_ENTERED")

#: How many overdue deliveries one step looks at.
_BATCH: Final = 100


@dataclass(frozen=True, slots=True)
class ReportApplier:
    """Applies mission reports; `queued` wakes booking when refused packages wait again."""

    db: Database
    writer: DeliveryWriter
    clock: FleetClock
    queued: Wake
    #: Called with a pickup when a drone of its network may be free again.
    freed: Callable[[StationId], None]
    #: Writes what composition has booked for a delivery; False if nothing could be learnt now.
    learn: Callable[[DeliveryId], Awaitable[bool]]
    #: Does what a report about proofs asks for, of a locked delivery.
    follow_proofs: Callable[[Tx, Delivery, MissionReport], Awaitable[None]]

    async def apply(self, report: MissionReport) -> None:
        """Apply a report; a report that was applied before changes nothing.

        Raises
        ------
        NotFound
            There is no such delivery: the report can be dropped.
        Conflict
            NOT_YET: an earlier report is missing, or composition could not be asked what it has
            booked; the sender repeats this one.
        """
        cached = self.writer.cache.pop(report.delivery_id)
        is_locked_first = report.kind in _ABOUT_PROOFS
        if cached is not None and not is_locked_first and await self._is_applied_to(cached, report):
            return
        # Another replica may have written the delivery last; usually it does not write it just now.
        async with self.db.read() as connection:
            stored = await delivery_store.read(connection, report.delivery_id)
        if not is_locked_first and await self._is_applied_to(stored, report):
            return
        if await self._apply_to_locked(report):
            return
        # The report comes before the answer to its booking: that answer may be lost.
        is_learnt = await self.learn(report.delivery_id)
        if not (is_learnt and await self._apply_to_locked(report)):
            detail = f"mission {report.mission_id} of attempt {report.attempt} is not planned yet"
            raise Conflict("NOT_YET", detail)

    async def apply_all(self, reports: Sequence[TracedReport]) -> None:
        """Apply reports, each in its own transaction, which is usually a single statement.

        Raises
        ------
        NotFound, Conflict
            As for `apply`, after all other reports are applied: one refusal holds up no other.
        """
        refused: NotFound | Conflict | None = None
        for each in reports:
            with tracing(each.traceparent, "apply report"):
                try:
                    await self.apply(each.report)
                except (NotFound, Conflict) as refusal:
                    refused = refusal
        if refused is not None:
            raise refused

    async def _is_applied_to(self, stored: StoredDelivery, report: MissionReport) -> bool:
        """Apply a report in one statement; False when the delivery or the report is out of date."""
        try:
            async with self.db.write() as tx:
                self._apply(tx, stored, report)
        except Outdated:
            return False
        return True

    async def _apply_to_locked(self, report: MissionReport) -> bool:
        """Whether the report is applied or out of date; False if its mission is not known yet."""
        async with self.db.write() as tx:
            # Lock before the read: two replicas may get reports of one mission at the same time.
            now = await delivery_store.lock(tx, report.delivery_id)
            last = await delivery_store.last_report(tx, report.mission_id)
            if last is None:
                if now.delivery.is_queued and report.attempt >= now.delivery.attempt:
                    return False
                with in_trace_of(now.traceparent):
                    _cancel_late_booking(tx, now.delivery, report)
            elif report.seq > last + 1:
                raise Conflict("NOT_YET", f"report {report.seq} comes before {last + 1}")
            elif report.seq == last + 1:
                self._apply(tx, now, report)
                if report.kind in _ABOUT_PROOFS:
                    await self.follow_proofs(tx, now.delivery, report)
        return True

    def _apply(self, tx: Tx, stored: StoredDelivery, report: MissionReport) -> None:
        progress = after_report(stored.delivery, report, host_delay=host_delay(self.clock))
        give_up = None
        if report.kind == "REFUSED" and progress.delivery.is_queued:
            # The waiting time starts again: the refused booking has used some of it.
            give_up = give_up_again_at(progress.delivery, self.clock)
            tx.after_commit(self.queued.set)
        if report.kind in _FREEING:
            pickup = stored.delivery.request.pickup.station_id
            tx.after_commit(partial(self.freed, pickup))
        self.writer.save(tx, stored, progress, report=report, give_up_at=give_up)


def _cancel_late_booking(tx: Tx, delivery: Delivery, report: MissionReport) -> None:
    """Cancel packages of a mission that was booked after the customer had cancelled them.

    The booking took longer than the claim of the process that asked for it.
    """
    cancelled = tuple(one.package_id for one in delivery.packages if one.state == "CANCELLED")
    if report.mission_state not in LIVE_MISSION_STATES or not cancelled:
        return
    reason, number = "it was booked after its packages had been cancelled", report.mission_id
    report_cancellation(tx, delivery, cancelled, reason=reason, cancellation_id=f"late_{number}")


@dataclass(frozen=True, slots=True)
class OverdueNotifier:
    """Records `delivery.delayed` when an ETA has passed without a hand-over."""

    db: Database
    writer: DeliveryWriter
    clock: FleetClock

    async def step(self) -> bool:
        """One step of the loop: look at overdue deliveries; True when there may be more."""
        before = self.clock.now() - timedelta(seconds=TOLERANCE_S) - host_delay(self.clock)
        async with self.db.read() as connection:
            found = await delivery_store.overdue(connection, before=before, limit=_BATCH)
        for delivery_id in found:
            await self.writer.write(delivery_id, change=self._marked_late)
        return len(found) == _BATCH

    def _marked_late(self, delivery: Delivery) -> Progress:
        now, host = self.clock.now(), host_delay(self.clock)
        return Progress(*when_overdue(delivery, at=now, host_delay=host))
