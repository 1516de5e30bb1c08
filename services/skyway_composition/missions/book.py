"""Booking: the best offer for a delivery becomes a mission, all or nothing.

One round looks at the world (network, pads, busy drones), makes offers in it without holding
anything, and then takes the best one in a single transaction: drone, pads, mission and its first
instruction. Whoever was faster made the database refuse one of these rows; then the next offer is
tried, or another round begins. The PUT behind this is keyed by (delivery, attempt), so asking
again answers what was booked.
"""

import logging
from dataclasses import dataclass, replace
from typing import Final

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.mission import Booking, BookMissions, ClosedDelivery
from skyway.ids import DeliveryId, DroneId, MissionId, StationId
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.database import Database, Tx
from skyway.runtime.errors import Taken
from skyway.runtime.loops import Wake
from skyway.runtime.minting import Mint
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.links.courier import Courier
from skyway_composition.links.store import lock_link, occupied_among
from skyway_composition.missions import store
from skyway_composition.missions.custody import Custodian, Held
from skyway_composition.missions.dispatch import dispatch
from skyway_composition.missions.instruct import StepTerms, flight_steps
from skyway_composition.missions.outcome import all_taken, pickup_unknown, without_offer
from skyway_composition.missions.record import MissionRecord
from skyway_composition.missions.revision import record_of
from skyway_composition.networks.prepared import PreparedNetworks
from skyway_composition.networks.store import share_version
from skyway_composition.pads.store import reserve
from skyway_composition.planning.offers import Offer, make_offers
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.world import World

log = logging.getLogger(__name__)

#: Rounds until the customer is told that all is taken (decisions.md, Booking).
_MOST_ROUNDS: Final = 5

#: A drone's row in a database rule that refused it: the pads may still be free for another drone.
_DRONE_TAKEN: Final = "mission_drone"


class _Outdated(Exception):
    """The world changed while offers were made: plan anew."""


@dataclass(frozen=True, slots=True)
class Bookings:
    """Books missions for deliveries; `pads_changed` is woken after each."""

    db: Database
    networks: PreparedNetworks
    solver: SolverPool
    clock: FleetClock
    mint: Mint
    pads_changed: Wake

    async def book(self, delivery_id: DeliveryId, wanted: BookMissions) -> Booking:
        """The missions of this attempt: those booked before, or one for the best offer."""
        reasons: tuple[ProviderReason, ...] = ()
        for round_number in range(_MOST_ROUNDS):
            async with self.db.read() as connection:
                booked = await store.missions_of(connection, delivery_id, attempt=wanted.attempt)
            if booked:
                return Booking(outcome="BOOKED", missions=booked)
            world = await self._look(wanted.request.pickup.station_id)
            if world is None:
                return pickup_unknown(wanted)
            offers = await make_offers(
                self.solver,
                world,
                wanted.request,
                candidates=wanted.candidates,
                busy=await self._busy(wanted),
                start_ms=self._start_ms(wanted, round_number),
            )
            if not offers.ranked:
                return without_offer(wanted, offers.reasons)
            reasons = offers.reasons
            booking = await self._take_best(delivery_id, wanted, world, offers.ranked)
            if booking is not None:
                return booking
        return all_taken(wanted, reasons)

    async def close(self, delivery_id: DeliveryId) -> ClosedDelivery:
        """Book nothing more for this delivery, unless something is booked already."""
        async with self.db.write() as tx:
            closed_ms = await store.lock_delivery(tx, delivery_id)
            if closed_ms is None:
                missions = await store.live_missions_of(tx.connection, delivery_id)
                if missions:
                    return ClosedDelivery(is_closed=False, missions=missions)
                await store.close_delivery(tx, delivery_id, moment_to_ms(self.clock.now()))
            return ClosedDelivery(is_closed=True)

    async def _look(self, pickup: StationId) -> World | None:
        skyway = await self.networks.around(pickup)
        if skyway is None:
            return None
        now_ms = moment_to_ms(self.clock.now())
        return await World.of(skyway, self.db, after_ms=now_ms)

    async def _take_best(
        self,
        delivery_id: DeliveryId,
        wanted: BookMissions,
        world: World,
        ranked: tuple[Offer, ...],
    ) -> Booking | None:
        """The booking of the best offer that nobody else has taken; None when a look is due."""
        for offer in ranked:
            try:
                async with self.db.write() as tx:
                    return await self._take(tx, delivery_id, wanted, world, offer)
            except Taken as taken:
                log.info("offer taken", extra={"delivery_id": delivery_id, "by": taken.constraint})
                if taken.constraint != _DRONE_TAKEN:
                    # Every other offer was planned around the same pads.
                    return None
            except _Outdated:
                return None
        return None

    async def _take(
        self, tx: Tx, delivery_id: DeliveryId, wanted: BookMissions, world: World, offer: Offer
    ) -> Booking:
        """Reserve the drone and the pads, and send the mission: one transaction.

        All rows that could be contended are locked in the same order by everybody: delivery,
        network, drone, mission, pads.
        """
        if await store.lock_delivery(tx, delivery_id) is not None:
            return Booking(outcome="CLOSED")
        booked = await store.missions_of(tx.connection, delivery_id, attempt=wanted.attempt)
        if booked:
            return Booking(outcome="BOOKED", missions=booked)
        await self._refuse_outdated(tx, world, offer)

        drone = offer.candidate
        link = await lock_link(tx, drone.drone_id, drone.provider_id)
        courier = Courier(self.clock, self.mint)
        record = record_of(
            drone,
            offer.trip,
            delivery_id=delivery_id,
            attempt=wanted.attempt,
            trip_number=1,
            mission_id=MissionId(self.mint("msn")),
            request=wanted.request,
            price=offer.price,
            skyway=world.skyway,
            expires_at=courier.expiry(),
        )
        steps = flight_steps(
            world.skyway.network,
            list(offer.trip.steps()),
            terms=StepTerms.of(record, world.skyway.settings),
            first_step=1,
        )
        await store.add(tx, record)
        await store.add_steps(tx, record.mission_id, steps, revision=1)
        await reserve(tx, record.mission_id, offer.trip.booked_pads)
        await _begin_custody(tx, record)
        await dispatch(
            tx,
            courier,
            replace(link, provider_id=drone.provider_id),
            mission=record.mission,
            steps=steps,
            expires_at=ms_to_moment(record.expires_ms),
        )
        tx.after_commit(self.pads_changed.set)
        return Booking(outcome="BOOKED", missions=(record.mission,))

    async def _refuse_outdated(self, tx: Tx, world: World, offer: Offer) -> None:
        # I11: the version is read inside the transaction, and cannot change before it ends.
        version = await share_version(tx, world.skyway.network_id)
        starts_too_soon = offer.trip.start_ms < moment_to_ms(self.clock.now())
        if version != world.skyway.version or starts_too_soon:
            raise _Outdated

    async def _busy(self, wanted: BookMissions) -> frozenset[DroneId]:
        drone_ids = [candidate.drone_id for candidate in wanted.candidates]
        async with self.db.read() as connection:
            busy = await store.busy_among(connection, drone_ids)
            # A drone that was given up on may still be out there with its mission.
            return busy | await occupied_among(connection, drone_ids)

    def _start_ms(self, wanted: BookMissions, round_number: int) -> int:
        """When the mission begins: late enough to plan it and to reach the drone."""
        margin = fleet_margin(self.clock, fleet_s=60, wall_s=2)
        # A round that came too late leaves the next one twice the time.
        start_at = self.clock.now() + margin * 2**round_number
        earliest_at = wanted.request.earliest_pickup_at
        if earliest_at is not None:
            start_at = max(start_at, earliest_at)
        return moment_to_ms(start_at) + 1


async def _begin_custody(tx: Tx, record: MissionRecord) -> None:
    """The pickup station holds what no earlier attempt has begun to carry."""
    held = await store.held_packages(tx.connection, record.mission.delivery_id)
    station = Custodian("STATION", record.request.pickup.station_id)
    rows = [
        Held(package.package_id, 1, station)
        for package in record.request.packages
        if package.package_id not in held
    ]
    await store.add_custody(tx, record, rows, at_ms=moment_to_ms(record.mission.start_at))
