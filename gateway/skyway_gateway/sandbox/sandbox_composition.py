"""`Composition` of the sandbox: it plans and books immediately, and holds nothing.

Its drones are free whenever they are asked for, so every offer can be kept.
"""

from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.forgotten_deliveries import ForgetDeliveries, KeptDeliveries
from skyway.contracts.mission import (
    Booking,
    BookMissions,
    Cancellation,
    CancelMissions,
    ClosedDelivery,
    Mission,
    OfferHold,
    WithdrawMissions,
)
from skyway.contracts.quote import KeepOffer, KeptOffer, QuoteAnswer, QuoteQuery
from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.contracts.track import Track
from skyway.ids import DeliveryId, HoldId, MissionId, PackageId, StationId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway_gateway.sandbox import store
from skyway_gateway.sandbox.network import NETWORK_ID, STATIONS
from skyway_gateway.sandbox.outcomes import outcome_of
from skyway_gateway.sandbox.script import AwaitedProofs, cancelled, proven, script_of
from skyway_gateway.sandbox.store import SandboxMission
from skyway_gateway.sandbox.track import track_of
from skyway_gateway.sandbox.trips import ranked_trips

#: Wall time between two reports of a mission, and before the first: until then the drone has not
#: accepted the mission, and the request can still be changed.
PACE: Final = timedelta(seconds=0.5)
_ACCEPTED_AFTER: Final = timedelta(seconds=1.5)

#: How long a drone waits for proofs, wall time.
PROOF_WAIT: Final = timedelta(seconds=60)

#: A delivery in these states gets no mission any more.
_OVER: Final = ("COMPLETED", "PARTIALLY_COMPLETED", "CANCELLED", "FAILED", "REJECTED")


@dataclass(frozen=True, slots=True)
class SandboxComposition:
    """Books the missions of test deliveries in the gateway's own database."""

    db: Database
    clock: FleetClock
    mint: Mint

    async def must_accept(self, pickup: StationId) -> None:
        """The sandbox is never closed."""

    async def check_stations(self, query: StationCheckQuery) -> StationCheck:
        """Which of the stations the sandbox has; ways lead between all of them."""
        known = [each for each in query.station_ids if each in STATIONS]
        return StationCheck(
            network_ids=dict.fromkeys(known, NETWORK_ID),
            positions={each: STATIONS[each].position for each in known},
            unknown=tuple(each for each in query.station_ids if each not in STATIONS),
        )

    async def quote(self, query: QuoteQuery) -> QuoteAnswer:
        """An offer of each provider, the best first; the request's outcome changes none."""
        trips, reasons = ranked_trips(query.request, query.shortlist, now=self.clock.now())
        held_until_at = None
        if query.hold is not None and trips:
            held_until_at = self.clock.wall_now() + timedelta(seconds=query.hold.life_s)
        is_held = held_until_at is not None
        return QuoteAnswer(
            offers=tuple(trip.terms(score, is_held=is_held) for score, trip in trips),
            infeasible=reasons,
            held_until_at=held_until_at,
        )

    async def keep(self, asked: KeepOffer) -> KeptOffer:
        """Every offer can be kept."""
        return KeptOffer(hold=asked.offer.hold or OfferHold(hold_id=asked.hold_id, number=0))

    async def release(self, hold_id: HoldId) -> None:
        """Nothing is held."""

    async def book(self, delivery_id: DeliveryId, requested: BookMissions) -> Booking:
        """Book the best trip, unless the outcome is another one; repeated, the same answer."""
        async with self.db.write() as tx:
            # Two replicas that book the same attempt wait for each other here.
            state = await store.lock_delivery(tx, delivery_id)
            for booked in await store.of_delivery(tx.connection, delivery_id):
                if booked.mission.attempt == requested.attempt:
                    return Booking(outcome="BOOKED", missions=(booked.mission,))
            if state is None or state in _OVER:
                return Booking(outcome="CLOSED")
            return await self._book(tx, delivery_id, requested)

    async def _book(self, tx: Tx, delivery_id: DeliveryId, requested: BookMissions) -> Booking:
        outcome, offer, shortlist = (
            outcome_of(requested.request),
            requested.offer,
            requested.shortlist,
        )
        if outcome == "busy":
            return Booking(outcome="BUSY", reasons=(_reason("BUSY", "all drones are busy"),))
        if outcome == "withdrawn" and requested.attempt > 1:
            gone = _reason("NO_PLAN_FOUND", "the provider has withdrawn its drones")
            return Booking(outcome="INFEASIBLE", reasons=(gone,))
        if offer is not None:
            shortlist = shortlist.of_provider(offer.provider_id)
            shortlist = shortlist.with_tariff(offer.provider_id, offer.tariff)
        trips, reasons = ranked_trips(requested.request, shortlist, now=self.clock.now())
        if not trips:
            return Booking(outcome="INFEASIBLE", reasons=reasons)
        mission_id = MissionId(self.mint("msn_test"))
        mission = trips[0][1].mission(delivery_id, mission_id, attempt=requested.attempt)
        needs_proof = [
            each.package_id
            for each in requested.request.packages
            if each.dropoff_verification is not None
        ]
        ends_at = max(mission.released_at, self.clock.now())
        awaited = AwaitedProofs(needs_proof, ends_at + PROOF_WAIT * self.clock.rate)
        booked = SandboxMission(mission, script_of(mission, outcome, awaited=awaited), played=0)
        await store.add(tx, booked, next_at=self.clock.wall_now() + _ACCEPTED_AFTER)
        return Booking(outcome="BOOKED", missions=(mission,))

    async def close(self, delivery_id: DeliveryId) -> ClosedDelivery:
        """Whether nothing was booked; the delivery's own state keeps it closed."""
        async with self.db.read() as connection:
            found = await store.of_delivery(connection, delivery_id)
        live = tuple(each.mission for each in found if not each.is_over)
        return ClosedDelivery(is_closed=not live, missions=live)

    async def cancel(self, delivery_id: DeliveryId, requested: CancelMissions) -> Cancellation:
        """Leave packages at the pickup, or have them brought back."""
        done = Cancellation()
        async with self.db.write() as tx:
            for each in await store.of_delivery(tx.connection, delivery_id):
                done = await self._cancel(tx, each.mission, requested, done)
        return done

    async def _cancel(
        self, tx: Tx, mission: Mission, requested: CancelMissions, done: Cancellation
    ) -> Cancellation:
        now = await store.locked(tx, mission.mission_id)
        if now is None or now.reports[-1].kind == "REFUSED":
            return done
        named = requested.package_ids or [each.package_id for each in mission.packages]
        reports, more = cancelled(
            mission, now.reports, now.played, package_ids=named, reason=requested.reason
        )
        if reports != now.reports:
            changed = SandboxMission(mission, reports, now.played)
            await store.save(tx, changed, next_at=self.clock.wall_now() + PACE)
        return Cancellation(
            released=(*done.released, *more.released),
            returning=(*done.returning, *more.returning),
            too_late=(*done.too_late, *more.too_late),
        )

    async def accept_proof(self, tx: Tx, delivery_id: DeliveryId, package_id: PackageId) -> None:
        """Let the drone that waits hand a package over; a repeated call changes nothing."""
        for each in await store.of_delivery(tx.connection, delivery_id):
            now = await store.locked(tx, each.mission.mission_id)
            if now is None:
                continue
            reports = proven(now.mission, now.reports, now.played, package_id)
            if reports != now.reports:
                changed = SandboxMission(now.mission, reports, now.played)
                await store.save(tx, changed, next_at=self.clock.wall_now() + PACE)

    async def withdraw(self, delivery_id: DeliveryId, requested: WithdrawMissions) -> None:
        """Give up a mission that its drone has not accepted; a repeated call changes nothing.

        Raises
        ------
        Conflict
            TOO_LATE: the drone has accepted the mission.
        """
        async with self.db.write() as tx:
            for each in await store.of_delivery(tx.connection, delivery_id):
                now = await store.locked(tx, each.mission.mission_id)
                if now is None or now.reports[-1].kind == "REFUSED":
                    continue
                if now.played:
                    detail = "a drone has its mission already: cancel the delivery"
                    raise Conflict("TOO_LATE", f"{detail}, and request another one")
                withdrawn = SandboxMission(now.mission, script_of(now.mission, "changed"), 0)
                await store.save(tx, withdrawn, next_at=self.clock.wall_now())

    async def track(self, delivery_id: DeliveryId) -> Track:
        """Where the delivery's drones are, as far as their reports have been played."""
        async with self.db.read() as connection:
            return track_of(await store.of_delivery(connection, delivery_id))

    async def forget(self, asked: ForgetDeliveries) -> KeptDeliveries:
        """Delete the missions of deliveries that ended long ago."""
        async with self.db.write() as tx:
            await store.delete_of(tx, asked.delivery_ids)
        return KeptDeliveries()


def _reason(code: str, detail: str) -> ProviderReason:
    return ProviderReason.model_validate(
        {"provider_id": None, "code": code, "detail": detail, "is_temporary": code == "BUSY"}
    )
