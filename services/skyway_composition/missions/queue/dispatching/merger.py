"""Decides which waiting missions become one: the host carries the packages of its guests too."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Final

from skyway.contracts.mission import PackageEta
from skyway.delivery.request import MAX_PACKAGES, MAX_TRIP_DESTINATIONS, DeliveryRequest
from skyway.ids import DroneId, MissionId, PackageId
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.share import Delay, Share, flight_id, ready_at
from skyway_composition.missions.queue.dispatching.fleet import Fleet, Orders

#: The most deliveries that share a trip, as in the search of `skyway.dispatch`.
MOST_SHARES: Final = 3


@dataclass(frozen=True, slots=True)
class Guest:
    """What a host carries for another delivery; the packages have the ids under which they fly."""

    share: Share
    request: DeliveryRequest
    etas: tuple[PackageEta, ...]


@dataclass(frozen=True, slots=True)
class Merge:
    """A waiting mission that carries the packages of other waiting missions, which then end.

    `host` has the packages of all, with the arrival times and promises that they have alone.
    """

    host: MissionRecord
    guests: tuple[MissionRecord, ...]


@dataclass(frozen=True, slots=True)
class MergedOrder:
    """An order of a fleet's waiting missions, without the guests of its merges."""

    orders: Orders
    merges: tuple[Merge, ...] = ()

    def changed_from(self, fleet: Fleet) -> frozenset[DroneId]:
        """The drones that get another order, or a mission with more packages."""
        present = fleet.orders
        hosts = {each.host.mission_id for each in self.merges}
        return frozenset(
            drone_id
            for drone_id, order in self.orders.items()
            if order != present[drone_id] or not hosts.isdisjoint(order)
        )


def carrying(host: MissionRecord, guest: Guest) -> MissionRecord | None:
    """The host's mission with the packages of both, to be planned again; None if it cannot be.

    It cannot be if their pickups differ, because a pickup does not change after the booking.
    """
    shares = host.shares or (share_of(host),)
    packages = (*host.request.packages, *guest.request.packages)
    destinations = {each.destination.station_id for each in packages}
    if len(shares) >= MOST_SHARES or len(packages) > MAX_PACKAGES:
        return None
    if len(destinations) > MAX_TRIP_DESTINATIONS:
        return None
    pickup = host.request.pickup
    if pickup != guest.request.pickup or pickup.station_id in destinations:
        return None
    if host.request.qos.priority != guest.request.qos.priority:
        return None
    delay = _delay(host, guest.request.earliest_pickup_at)
    earliest_at = host.request.earliest_pickup_at
    if delay is not None:
        earliest_at = max(delay.ready_at, earliest_at or delay.ready_at)
    update = {"packages": packages, "earliest_pickup_at": earliest_at}
    etas = host.mission.packages + guest.etas
    return replace(
        host,
        request=host.request.model_copy(update=update),
        mission=host.mission.model_copy(update={"packages": etas}),
        shares=(*shares, guest.share.model_copy(update={"delay": delay})),
    )


def _delay(host: MissionRecord, guest_at: datetime | None) -> Delay | None:
    """How much later than its host a guest is ready; None if it is not later."""
    host_at = ready_at(host.shares, (), planned_at=host.request.earliest_pickup_at)
    if guest_at is None or (host_at is not None and guest_at <= host_at):
        return None
    return Delay(host_at=host_at, ready_at=guest_at)


def share_of(record: MissionRecord) -> Share:
    """The share of the delivery whose mission it is."""
    mission = record.mission
    return Share(
        mission_id=mission.mission_id,
        delivery_id=mission.delivery_id,
        attempt=mission.attempt,
        trip=mission.trip,
        price=mission.price,
        pooled_price=mission.price.pooled(record.candidate.tariff),
        payment_terms=mission.payment_terms,
        packages={each.package_id: each.package_id for each in record.request.packages},
        traceparent=record.traceparent,
    )


def may_merge(record: MissionRecord) -> bool:
    """Whether a waiting mission may carry packages of others, or be carried by another mission."""
    has_room = len(record.shares) < MOST_SHARES and record.mission.trip == 1
    has_room = has_room and record.mission.firm_at is None
    return has_room and record.may_be_shared and not record.aims


def merged_order(
    fleet: Fleet, orders: Orders, shared: Collection[Sequence[MissionId]]
) -> MergedOrder:
    """The order in which the missions of each shared trip become one.

    `orders` has the missions of a shared trip one after another. Missions that may not share the
    trip stay where they are in it.
    """
    missions = {each.mission_id: each for each in fleet.waiting}
    drone_of = {each: drone_id for drone_id, order in orders.items() for each in order}
    merges = (_merge([missions[each] for each in trip], drone_of[trip[0]]) for trip in shared)
    found = tuple(each for each in merges if each.guests)
    gone = {guest.mission_id for each in found for guest in each.guests}
    left = {
        drone_id: tuple(each for each in order if each not in gone)
        for drone_id, order in orders.items()
    }
    return MergedOrder(left, found)


def _merge(records: Sequence[MissionRecord], drone_id: DroneId) -> Merge:
    """One of these missions as the host for the drone, with as many guests as it may have.

    The host is a mission that cannot be a guest. Without one it is a mission of this drone.
    """
    host, *others = sorted(
        records, key=lambda each: (_may_be_guest(each), each.drone_id != drone_id, each.mission_id)
    )
    host = replace(host, promised=tuple(host.promises.values()))
    guests = []
    for each in filter(_may_be_guest, others):
        together = carrying(host, _guest_of(each))
        if together is not None and each.mission.provider_id == host.mission.provider_id:
            host = replace(together, promised=(*host.promised, *_flying(each, each.promises)))
            guests.append(each)
    return Merge(host, tuple(guests))


def _may_be_guest(record: MissionRecord) -> bool:
    """Whether the mission has no guests, and no drone has refused its delivery."""
    return not record.shares and record.mission.attempt == 1


def _guest_of(record: MissionRecord) -> Guest:
    """A waiting mission as a guest, which keeps the id of the mission."""
    flying = _flight_ids(record)
    packages = tuple(
        each.model_copy(update={"package_id": flying[each.package_id]})
        for each in record.request.packages
    )
    own_of_flying = {flown: own for own, flown in flying.items()}
    share = share_of(record)
    return Guest(
        share.model_copy(update={"packages": own_of_flying, "report_seq": record.report_seq}),
        record.request.model_copy(update={"packages": packages}),
        _flying(record, {each.package_id: each for each in record.mission.packages}),
    )


def _flying(record: MissionRecord, etas: dict[PackageId, PackageEta]) -> tuple[PackageEta, ...]:
    """The arrival times by the ids under which the packages of a guest fly."""
    return tuple(
        etas[own].model_copy(update={"package_id": flown})
        for own, flown in _flight_ids(record).items()
        if own in etas
    )


def _flight_ids(record: MissionRecord) -> dict[PackageId, PackageId]:
    """The ids under which the mission's packages fly as those of a guest."""
    return {
        each.package_id: flight_id(record.mission_id, number)
        for number, each in enumerate(record.request.packages, 1)
    }
