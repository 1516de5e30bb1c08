"""Which waiting missions another provider may fly: all three parties agree, by standing rules."""

from collections.abc import Collection, Iterable

from skyway.contracts.candidate import Candidate
from skyway.delivery.plan import Plan
from skyway.ids import DroneId, MissionId, ProviderId
from skyway.network.network import Network
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.queue.dispatching.fleet import Fleet
from skyway_composition.planning.offer import distance_flown_m, price_of_plan


def may_fly(
    record: MissionRecord, drone: Candidate, plan: Plan, *, fleet: Fleet, network: Network
) -> bool:
    """Whether this drone may fly the mission by this plan.

    A drone of another provider may if the customer and both providers agree, if the mission flies
    for one delivery, if it is loaded in the same way, and if the other provider's tariff asks for
    at most the price that the customer has accepted.
    """
    own_id, other_id = record.mission.provider_id, drone.provider_id
    if own_id == other_id:
        return True
    qos, tariff = record.request.qos, fleet.tariffs.get(other_id)
    if tariff is None or own_id not in fleet.tariffs or not qos.may_change_provider:
        return False
    is_alike = not record.shares and drone.loading == record.candidate.loading
    if not is_alike or not qos.providers.admits(other_id):
        return False
    distance_m = distance_flown_m(network, plan)
    asked = price_of_plan(tariff, plan, record.request, distance_m=distance_m)
    agreed = record.mission.price
    return asked.currency == agreed.currency and asked.amount <= agreed.amount


def providers_of(
    record: MissionRecord, fleet: Fleet, network: Network, *, may_merge: Collection[MissionId]
) -> tuple[ProviderId, ...] | None:
    """The providers whose drones may fly a mission as it is planned now; None: those of the fleet.

    A mission that may share a trip stays with its provider.
    """
    if not fleet.tariffs:
        return None
    own_id, plan = record.mission.provider_id, record.mission.plan
    drones = [each.candidate for each in fleet.calendars.values()]
    refused = {
        each.provider_id
        for each in drones
        if record.mission_id in may_merge
        or not may_fly(record, each, plan, fleet=fleet, network=network)
    }
    return tuple(sorted({own_id, *(each.provider_id for each in drones)} - (refused - {own_id})))


def refused_by(
    changes: Iterable[tuple[MissionRecord, MissionRecord]], fleet: Fleet, network: Network
) -> frozenset[DroneId]:
    """The drones that may not fly a mission as it is planned now, the second of each pair."""
    return frozenset(
        after.drone_id
        for before, after in changes
        if not may_fly(
            before,
            fleet.calendars[after.drone_id].candidate,
            after.mission.plan,
            fleet=fleet,
            network=network,
        )
    )
