"""A month of deliveries in the ledger: whether both sides add up, with each other and the prices.

`python -m skyway_lab ledger_month [--deliveries 10000] [--seed 1]` writes each delivery as the
gateway does: request, booking, mission reports, cancellations. Only REST is left out. A fifth comes
late, and some are cancelled or lost. In the middle of the month all tariffs rise, and one provider
changes its currency. Then the month is closed, one mission is corrected, and `skyway verify`'s
rules look at the database.
"""

import argparse
import asyncio
import random
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Final

from skyway_gateway.deliveries.lifecycle.booking_effects import after_booking, after_cancellation
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.progress import Progress
from skyway_gateway.deliveries.lifecycle.report_effects import after_report
from skyway_gateway.deliveries.records.delivery_rows import (
    DeliveryCache,
    QueuedDelivery,
    StoredDelivery,
)
from skyway_gateway.deliveries.records.delivery_store import lock
from skyway_gateway.deliveries.records.write_delivery import DeliveryWriter
from skyway_gateway.deliveries.requests.accept import new_delivery
from skyway_gateway.delivery_tables import missions
from skyway_gateway.ledger.close_months import MonthClosing
from skyway_gateway.ledger.correct import correct
from skyway_gateway.ledger.statement import Correction, StatementQuery
from skyway_gateway.ledger.store import statements_page
from skyway_gateway.notifications.delivery_events import EventListeners, EventRecorder
from skyway_gateway.tables import outbox
from skyway_verifier.check import Checked, check
from skyway_verifier.gateway.ledger import LEDGER
from sqlalchemy import func, select

from skyway.contracts.mission import Cancellation, Mission, PackageEta
from skyway.contracts.mission_reports import MissionReport
from skyway.delivery.offer import Tariff, price_of
from skyway.delivery.payment_terms import CancellationTerms, LateStep, PaymentTerms
from skyway.delivery.plan import Plan, PlanStatus
from skyway.delivery.request import DeliveryRequest
from skyway.geo import Position
from skyway.ids import DeliveryId, SubjectId
from skyway.runtime.clock import ManualClock
from skyway.runtime.loops import Wake
from skyway.runtime.minting import mint
from skyway.runtime.sql.claims import FREE
from skyway.runtime.sql.database import Database
from skyway.runtime.sql.migrations import migrate

_START: Final = datetime(2026, 3, 1, tzinfo=UTC)
_MONTH: Final = "2026-03"
_TERMS: Final = PaymentTerms(
    cancellation=CancellationTerms(until_loaded=0.2, in_flight=0.85),
    late=(LateStep(after_min=15, share=0.1), LateStep(after_min=60, share=0.5)),
)
_OUTCOMES: Final = ("in time", "late", "cancelled", "cancelled in flight", "lost")
_SHARES: Final = (60, 20, 10, 5, 5)


def tariff_of(provider: int, *, is_second_half: bool) -> Tariff:
    """The tariff of a provider, which rises in the middle of the month."""
    currency = "EUR" if provider == 4 and is_second_half else "USD"
    base = 333 + 57 * provider + 50 * is_second_half
    return Tariff(
        currency=currency, base=base, per_km=21, per_kg=13, minimum=700, payment_terms=_TERMS
    )


@dataclass(frozen=True, slots=True)
class Month:
    """The parts of a gateway that write a month, and a clock that is set forward."""

    db: Database
    clock: ManualClock
    writer: DeliveryWriter
    chance: random.Random

    async def deliver(self, number: int, *, outcome: str, is_second_half: bool) -> None:
        """Write a delivery of two packages from its request to its end."""
        delivery_id = DeliveryId(f"dlv_{number:06d}")
        request = DeliveryRequest.model_validate(
            {
                "pickup": {"station_id": "a"},
                "packages": [
                    {"package_id": each, "mass_kg": 0.7, "destination": {"station_id": "b"}}
                    for each in ("p1", "p2")
                ],
            }
        )
        customer_id = SubjectId(f"customer-{self.chance.randrange(20)}")
        accepted = new_delivery(
            delivery_id, customer_id=customer_id, request=request, offer=None, at=self.clock.now()
        )
        queued = QueuedDelivery(StoredDelivery(accepted), Position(0, 0), self.clock.now())
        async with self.db.write() as tx:
            self.writer.add(tx, queued, (), claim=FREE)
        late = timedelta(minutes=self.chance.uniform(1, 120) if outcome == "late" else 0)
        due_at = self.clock.now() - late
        mission = self._mission(number, request, due_at=due_at, is_second_half=is_second_half)
        await self._change(
            delivery_id, lambda now: after_booking(now, [mission], at=self.clock.now())
        )
        await self._fly(mission, outcome)

    def _mission(
        self, number: int, request: DeliveryRequest, *, due_at: datetime, is_second_half: bool
    ) -> Mission:
        provider = self.chance.randrange(5)
        tariff = tariff_of(provider, is_second_half=is_second_half)
        distance_m = self.chance.uniform(1_000, 40_000)
        return Mission(
            mission_id=f"msn_{number:06d}",
            delivery_id=f"dlv_{number:06d}",
            attempt=1,
            provider_id=f"provider-{provider}",
            drone_id=f"drn_{provider}",
            drone_model_id="any",
            state="BOOKED",
            revision=1,
            start_at=self.clock.now(),
            released_at=self.clock.now(),
            price=price_of(
                tariff,
                distance_m=distance_m,
                payload_kg=request.payload_kg,
                recharging_s=0.0,
                priority=self.chance.choice(("STANDARD", "PRIORITY")),
            ),
            payment_terms=tariff.payment_terms,
            packages=tuple(
                PackageEta(package_id=each.package_id, eta_at=due_at) for each in request.packages
            ),
            plan=Plan(status=PlanStatus.OPTIMAL, delivery_time_s=0.0),
            pickup_station_id="a",
        )

    async def _fly(self, mission: Mission, outcome: str) -> None:
        report = partial(self._report, mission)
        both = tuple(each.package_id for each in mission.packages)
        if outcome == "cancelled":
            await self._cancel(mission, Cancellation(released=both))
            return
        await report("LOADED", 1)
        if outcome == "cancelled in flight":
            await self._cancel(mission, Cancellation(returning=both))
            await report("RETURNED", 2, package_ids=both, station_id="a", code="CANCELLED")
        elif outcome == "lost":
            await report("DELIVERED", 2, package_ids=both[:1])
            await report("ENDED", 3, mission_state="ABORTED", code="BATTERY")
        else:
            await report("DELIVERED", 2, package_ids=both)

    async def _cancel(self, mission: Mission, done: Cancellation) -> None:
        packages = tuple(each.package_id for each in mission.packages)
        cancel = partial(
            after_cancellation,
            requested=packages,
            done=done,
            reason="no need",
            at=self.clock.now(),
            host_delay=timedelta(0),
        )
        await self._change(mission.delivery_id, cancel)

    async def _report(
        self,
        mission: Mission,
        kind: str,
        seq: int,
        *,
        mission_state: str = "ACTIVE",
        **about: object,
    ) -> None:
        names = ("delivery_id", "attempt", "trip", "mission_id", "provider_id", "drone_id")
        report = MissionReport.model_validate(
            {
                **{name: getattr(mission, name) for name in names},
                "report_id": mint("rpt"),
                "seq": seq,
                "kind": kind,
                "at": self.clock.now(),
                "mission_state": mission_state,
                **about,
            }
        )
        change = partial(after_report, report=report, host_delay=timedelta(0))
        await self._change(mission.delivery_id, change, report=report)

    async def _change(
        self,
        delivery_id: DeliveryId,
        change: Callable[[Delivery], Progress],
        *,
        report: MissionReport | None = None,
    ) -> None:
        async with self.db.write() as tx:
            before = await lock(tx, delivery_id)
            self.writer.save(tx, before, change(before.delivery), report=report)


@dataclass(frozen=True, slots=True)
class Sums:
    """What the month comes to, by currency, as each part of the gateway says it."""

    customers: Mapping[str, int]
    providers: Mapping[str, int]
    charges: Mapping[str, int]
    statements: int
    lines: int
    #: Whether a correction after the month was closed left its statements as they were.
    is_closed: bool
    broken_rules: tuple[str, ...]

    @property
    def do_agree(self) -> bool:
        """Whether all parts say the same, and no rule is broken."""
        is_same = self.customers == self.providers == self.charges
        return is_same and self.is_closed and not self.broken_rules


async def play(url: str, *, deliveries: int, seed: int) -> Sums:
    """Write a month of deliveries into a new database, close the month, and add it up."""
    await migrate(url, "skyway_gateway")
    chance, clock = random.Random(seed), ManualClock(_START)
    async with Database(url, outbox=outbox) as db:
        events = EventRecorder(clock=clock, mint=mint, listeners=EventListeners(), webhooks=Wake())
        writer = DeliveryWriter(db, events, DeliveryCache(), clock)
        month = Month(db, clock, writer, chance)
        for number in range(deliveries):
            begin = _START + number * (timedelta(days=30) / deliveries)
            clock.advance(begin - clock.now())
            [outcome] = chance.choices(_OUTCOMES, _SHARES)
            is_second_half = number * 2 >= deliveries
            await month.deliver(number, outcome=outcome, is_second_half=is_second_half)
        return await _closed_sums(month)


async def _closed_sums(month: Month) -> Sums:
    clock = month.clock
    clock.advance(datetime(2026, 4, 5, tzinfo=UTC) - clock.now())
    await MonthClosing(month.db, clock, mint, Wake()).step()
    query = StatementQuery(limit=200)
    async with month.db.read() as connection:
        closed = await statements_page(connection, query, month=_MONTH)
        by_currency = select(missions.c.currency, func.sum(missions.c.charged_amount))
        charged = await connection.execute(by_currency.group_by(missions.c.currency))
        charges = {currency: int(amount) for currency, amount in charged}
    async with month.db.write() as tx:
        await correct(tx, Correction(mission_id="msn_000000", amount=1, note="a test"), clock)
    async with month.db.read() as connection:
        after = await statements_page(connection, query, month=_MONTH)
    found = await check(
        {"gateway": Checked(month.db, LEDGER)}, wall_at=clock.wall_now(), fleet_at=clock.now()
    )
    sides: dict[str, Counter[str]] = {"customer": Counter(), "provider": Counter()}
    for statement in closed:
        sides[statement.role][statement.currency] += statement.amount
    return Sums(
        customers=dict(sides["customer"]),
        providers=dict(sides["provider"]),
        charges=charges,
        statements=len(closed),
        lines=sum(each.lines for each in closed if each.role == "customer"),
        is_closed=after == closed and all(each.closed_at for each in closed),
        broken_rules=tuple(each.rule for each in found.broken["gateway"]),
    )


def main() -> None:
    """Play the month, and print its sums; the exit code is 1 if they do not agree."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--deliveries", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        url = f"sqlite:///{Path(folder) / 'gateway.db'}"
        sums = asyncio.run(play(url, deliveries=given.deliveries, seed=given.seed))
    print(f"{given.deliveries:,} deliveries, {sums.lines:,} lines, {sums.statements} statements")
    for currency, amount in sorted(sums.charges.items()):
        customers, providers = sums.customers.get(currency), sums.providers.get(currency)
        print(f"{currency}: charged {amount}, customers pay {customers}, providers get {providers}")
    print(f"closed month unchanged by a correction: {sums.is_closed}")
    print(f"broken rules: {list(sums.broken_rules)}")
    raise SystemExit(not sums.do_agree)


if __name__ == "__main__":
    main()
