"""Finds a waiting mission that carries a new request's packages too: the request joins it.

The mission of another delivery is planned again with the packages of both. The request joins if its
own QoS ranks the shared trip before its best offer alone, and if no package on the drone comes
later than its promise by more than the tolerance.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Final

import numpy as np

from skyway.contracts.mission import BookMissions, PackageEta
from skyway.delivery.offer import OfferValues, rank_offers
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, MissionId, ProviderId, StationId
from skyway.network.great_circle import distances_m
from skyway.network.network import Network
from skyway.runtime.tracing import current_traceparent
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.context import Context
from skyway_composition.links.store import held_among, links_to
from skyway_composition.margins import HAND_OVER, JOINS
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.share import NearPickup, Share, flight_id
from skyway_composition.missions.queue import store
from skyway_composition.missions.queue.dispatching.adopt import BetterOrder, JoinedTrip
from skyway_composition.missions.queue.dispatching.fleet import (
    Fleet,
    Moments,
    fleet_of,
    free_to_take_off,
)
from skyway_composition.missions.queue.dispatching.merger import Guest, carrying
from skyway_composition.missions.queue.dispatching.plan_orders import NoOrder, plan_orders
from skyway_composition.missions.queue.plan_queue import etas_ms, latest_ms
from skyway_composition.planning.offer import Offer, Offers
from skyway_composition.planning.world import World

#: How fast customers walk to another station, along the straight line, m/s. Our own choice.
_CARRYING_MPS: Final = 1.0
#: A degree of latitude is at least so long, metres.
_DEGREE_M: Final = 110_000.0

#: How many waiting missions a request is compared with. Our own choice.
_MOST_HOSTS: Final = 5


@dataclass(frozen=True, slots=True)
class _JoiningRequest:
    """A request that may join, its best offer alone, and the best offer alone of each provider."""

    delivery_id: DeliveryId
    requested: BookMissions
    best: Offer
    of_provider: Mapping[ProviderId, Offer]

    @property
    def request(self) -> DeliveryRequest:
        """The request."""
        return self.requested.request


@dataclass(frozen=True, slots=True)
class _Pickups:
    """The stations where a request's packages may be handed over, and when they can be there.

    `away_m` has each of these stations, the own pickup too, with its distance from that pickup.
    """

    own: StationId
    within_m: float
    away_m: Mapping[StationId, float]
    now_ms: int

    @classmethod
    def of(cls, request: DeliveryRequest, network: Network, *, now_ms: int) -> "_Pickups":
        """The pickups that the request allows."""
        own, within_m = request.pickup.station_id, request.qos.pickup_within_m
        away_m = {own: 0.0} | ({} if within_m == 0 else _around(network, own, within_m=within_m))
        return cls(own, within_m, away_m, now_ms)

    @property
    def ready_ms(self) -> Mapping[StationId, int]:
        """When the packages can be at each station; 0 at the request's own pickup."""
        return {each: self._there_ms(each) for each in self.away_m}

    def may_wait(self, host: MissionRecord, *, tolerance_s: float) -> bool:
        """Whether all promises of the host allow it to start when the packages are there."""
        later_ms = self._there_ms(host.request.pickup.station_id) - host.start.at_ms
        latest = latest_ms(host, tolerance_s=tolerance_s)
        return all(at_ms + later_ms <= latest[each] for each, at_ms in etas_ms(host).items())

    def near(self, pickup: StationId) -> NearPickup | None:
        """What the guest's share notes about this pickup; None for the request's own pickup."""
        if pickup == self.own:
            return None
        away_m = self.away_m[pickup]
        return NearPickup(asked_station_id=self.own, within_m=self.within_m, away_m=away_m)

    def ready_at(self, pickup: StationId, own_at: datetime | None) -> datetime | None:
        """The moment before which no drone may load there; `own_at` is that of the request."""
        if pickup == self.own:
            return own_at
        there_at = ms_to_moment(self._there_ms(pickup))
        return there_at if own_at is None else max(own_at, there_at)

    def _there_ms(self, pickup: StationId) -> int:
        if pickup == self.own:
            return 0
        return self.now_ms + math.ceil(1000 * self.away_m[pickup] / _CARRYING_MPS)


def _around(network: Network, own: StationId, *, within_m: float) -> dict[StationId, float]:
    """The stations within so many metres of a station, and how far they are."""
    columns, row = network.columns, network.row_of.get(own)
    if row is None:  # a new version of the network has removed the station
        return {}
    north_deg = np.abs(columns.latitude_deg - columns.latitude_deg[row])
    rows = np.flatnonzero(north_deg <= within_m / _DEGREE_M)
    here = np.full(len(rows), row)
    away_m = distances_m(
        (columns.longitude_deg[here], columns.longitude_deg[rows]),
        (columns.latitude_deg[here], columns.latitude_deg[rows]),
    )
    return {
        columns.station_ids[each]: metres
        for each, metres in zip(rows.tolist(), away_m.tolist(), strict=True)
        if metres <= within_m
    }


@dataclass(frozen=True, slots=True)
class HostFinder:
    """Finds waiting missions that requests can join."""

    context: Context
    tolerance_s: float

    async def find(
        self, delivery_id: DeliveryId, requested: BookMissions, offers: Offers
    ) -> JoinedTrip | None:
        """The best shared trip, if it ranks before the request's best offer alone; else None."""
        asked = _asked(delivery_id, requested, offers)
        if asked is None:
            return None
        times = self._times()
        skyway = await self.context.networks.around(asked.request.pickup.station_id)
        if skyway is None:
            return None
        pickups = _Pickups.of(asked.request, skyway.network, now_ms=times.now_ms)
        world = await World.of(skyway, self.context.db, after_ms=times.now_ms)
        async with self.context.db.read() as connection:
            hosts = await store.hosts_at(
                connection,
                skyway.network_id,
                pickups.ready_ms,
                provider_ids=asked.of_provider.keys(),
                limit=_MOST_HOSTS,
            )
        trips = [await self._joined_trip(asked, host, pickups, world, times) for host in hosts]
        found = [each for each in trips if each is not None]
        values = [asked.best.values, *(_values(asked, each) for each in found)]
        first = rank_offers(values, asked.request.qos.ranking)[0]
        return found[first - 1] if first else None

    async def _joined_trip(
        self,
        asked: _JoiningRequest,
        host: MissionRecord,
        pickups: _Pickups,
        world: World,
        times: Moments,
    ) -> JoinedTrip | None:
        """The shared trip with this mission; None if it has no plan or breaks a promise."""
        if not pickups.may_wait(host, tolerance_s=self.tolerance_s):
            return None
        fleet = free_to_take_off(await self._fleet_of(host, times), world, times)
        if host not in fleet.waiting or not fleet.is_planned_in(world.present):
            return None
        together = self._together(asked, host, pickups)
        if together is None:
            return None
        moved = await plan_orders(
            self.context,
            world,
            fleet,
            fleet.orders,
            instead=[together],
            times=times,
            tolerance_s=self.tolerance_s,
        )
        if isinstance(moved, NoOrder):
            return None
        order = BetterOrder(fleet, world, times, moved)
        if order.judged(tolerance_s=self.tolerance_s).late:
            return None
        return JoinedTrip(order, together.shares[-1])

    async def _fleet_of(self, host: MissionRecord, times: Moments) -> Fleet:
        """The calendar of the mission's drone; no calendar if nothing in it may change now."""
        async with self.context.db.read() as connection:
            found = await store.open_missions_on(connection, [host.drone_id])
            held = await held_among(connection, [host.drone_id], now_ms=times.now_ms)
            links = await links_to(connection, [host.drone_id])
        return fleet_of(found.records, links, versions=found.versions, left_out=held, times=times)

    def _together(
        self, asked: _JoiningRequest, host: MissionRecord, pickups: _Pickups
    ) -> MissionRecord | None:
        """The mission with the packages of both, to be planned again; None if they do not fit."""
        request, solo = asked.request, asked.of_provider[host.mission.provider_id]
        tariff = solo.parts[0].candidate.tariff
        pickup = host.request.pickup
        mission_id = MissionId(self.context.mint("msn"))
        flying = {
            flight_id(mission_id, number): each for number, each in enumerate(request.packages, 1)
        }
        share = Share(
            mission_id=mission_id,
            delivery_id=asked.delivery_id,
            attempt=asked.requested.attempt,
            price=solo.price,
            pooled_price=solo.price.pooled(tariff),
            payment_terms=tariff.payment_terms,
            packages={flown: each.package_id for flown, each in flying.items()},
            traceparent=current_traceparent(),
            near=pickups.near(pickup.station_id),
        )
        added = tuple(
            each.model_copy(update={"package_id": flown}) for flown, each in flying.items()
        )
        # A guest may begin before it has waited for others, but not before its packages are there.
        ready_at = pickups.ready_at(pickup.station_id, asked.requested.ready_at)
        update = {"pickup": pickup, "packages": added, "earliest_pickup_at": ready_at}
        etas = tuple(PackageEta(package_id=each, eta_at=host.mission.start_at) for each in flying)
        return carrying(host, Guest(share, request.model_copy(update=update), etas))

    def _times(self) -> Moments:
        now_ms = self.context.now_ms
        return Moments(
            now_ms, now_ms + JOINS.ms(self.context.clock), HAND_OVER.ms(self.context.clock)
        )


def _asked(
    delivery_id: DeliveryId, requested: BookMissions, offers: Offers
) -> _JoiningRequest | None:
    """The request, if it may share a trip and one drone can fly it alone; else None.

    A drone that has refused a delivery must not get it again, so only first attempts join.
    """
    request = requested.request
    if not request.may_share_trip or requested.attempt > 1 or requested.offer is not None:
        return None
    whole = [each for each in offers.ranked if len(each.parts) == 1]
    if not whole:
        return None
    best, of_provider = offers.ranked[0], dict[ProviderId, Offer]()
    for each in whole:
        # A guest that is left alone pays the full price, which must not be above the best offer's.
        if request.qos.ranking.price == 0 or each.price.amount <= best.price.amount:
            of_provider.setdefault(each.provider_id, each)
    return _JoiningRequest(delivery_id, requested, best, of_provider) if of_provider else None


def _values(asked: _JoiningRequest, trip: JoinedTrip) -> OfferValues:
    """What the request's ranking looks at: its own arrival, price, and the energy that it adds."""
    record, before = trip.record, trip.host_before
    solo = asked.of_provider[record.mission.provider_id].values
    own = [
        each.eta_at for each in record.mission.packages if each.package_id in trip.guest.packages
    ]
    energy_j = (record.mission.plan.energy_j or 0.0) - (before.mission.plan.energy_j or 0.0)
    return replace(
        solo,
        time_s=(moment_to_ms(max(own)) - asked.best.begins_ms) / 1000,
        price=trip.guest.pooled_price.amount,
        energy_j=max(0.0, energy_j),
        drone_id=record.drone_id,
    )
