"""The mission that the world sees: from the offer that was taken, and from each new plan."""

from datetime import datetime, timedelta

from skyway.contracts.mission import BookMissions, Mission, PackageEta
from skyway.delivery.plan import Plan
from skyway.ids import DeliveryId, MissionId, NetworkId
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.missions.record import MissionRecord
from skyway_composition.planning.offers import Offer
from skyway_composition.planning.trip import Trip


def record_of(
    offer: Offer,
    wanted: BookMissions,
    *,
    mission_id: MissionId,
    delivery_id: DeliveryId,
    network_id: NetworkId,
    expires_at: datetime,
) -> MissionRecord:
    """A new mission that takes an offer; its first instruction expires at `expires_at`."""
    candidate, trip = offer.candidate, offer.trip
    start_at = ms_to_moment(trip.start_ms)
    mission = Mission(
        mission_id=mission_id,
        delivery_id=delivery_id,
        attempt=wanted.attempt,
        provider_id=candidate.provider_id,
        drone_id=candidate.drone_id,
        drone_model_id=candidate.model.model_id,
        state="BOOKED",
        revision=1,
        start_at=start_at,
        released_at=ms_to_moment(trip.released_ms),
        price=offer.price,
        packages=_etas(trip.plan, start_at),
        plan=trip.plan,
        home_plan=trip.home_plan,
        home_recharge=trip.home_recharge,
    )
    return MissionRecord(
        mission=mission,
        network_id=network_id,
        request=wanted.request,
        candidate=candidate,
        expires_ms=moment_to_ms(expires_at),
    )


def next_revision(mission: Mission, trip: Trip) -> Mission:
    """The mission once this trip replaces what was left of its plan; the price stays."""
    start_at = ms_to_moment(trip.start_ms)
    fresh = {eta.package_id: eta for eta in _etas(trip.plan, start_at)}
    return mission.model_copy(
        update={
            "revision": mission.revision + 1,
            "start_at": start_at,
            "released_at": ms_to_moment(trip.released_ms),
            "packages": tuple(fresh.get(eta.package_id, eta) for eta in mission.packages),
            "plan": trip.plan,
            "home_plan": trip.home_plan,
            "home_recharge": trip.home_recharge,
        }
    )


def _etas(plan: Plan, start_at: datetime) -> tuple[PackageEta, ...]:
    return tuple(
        PackageEta(
            package_id=delivery.package_id,
            eta_at=start_at + timedelta(seconds=delivery.delivered_s),
        )
        for delivery in plan.deliveries
    )
