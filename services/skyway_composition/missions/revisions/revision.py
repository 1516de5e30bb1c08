"""The mission that the world sees: from the offer that was taken, and from each new plan."""

from datetime import datetime, timedelta

from skyway.contracts.candidate import Candidate
from skyway.contracts.mission import Margins, Mission, PackageEta
from skyway.delivery.offer import Price
from skyway.delivery.plan import Plan
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, MissionId
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.missions.record import MissionRecord
from skyway_composition.networks.prepared import PreparedNetwork
from skyway_composition.planning.trip import Trip


def record_of(
    candidate: Candidate,
    trip: Trip,
    *,
    delivery_id: DeliveryId,
    attempt: int,
    trip_number: int,
    mission_id: MissionId,
    request: DeliveryRequest,
    price: Price,
    skyway: PreparedNetwork,
    expires_at: datetime,
) -> MissionRecord:
    """A new mission that flies a trip; `request` holds the packages of this trip only.

    Its first instruction expires at `expires_at`.
    """
    start_at = ms_to_moment(trip.start_ms)
    mission = Mission(
        mission_id=mission_id,
        delivery_id=delivery_id,
        attempt=attempt,
        trip=trip_number,
        provider_id=candidate.provider_id,
        drone_id=candidate.drone_id,
        drone_model_id=candidate.model.model_id,
        state="BOOKED",
        revision=1,
        start_at=start_at,
        released_at=ms_to_moment(trip.released_ms),
        price=price,
        packages=_etas(trip.plan, start_at),
        plan=trip.plan,
        home_plan=trip.home_plan,
        home_recharge=trip.home_recharge,
        margins=skyway.settings.margins,
        loading="AWAITED" if candidate.loading == "CONFIRMED" else "AUTOMATIC",
    )
    return MissionRecord(
        mission=mission,
        network_id=skyway.network_id,
        request=request,
        candidate=candidate,
        expires_ms=moment_to_ms(expires_at),
    )


def next_revision(mission: Mission, trip: Trip, *, revision: int, margins: Margins) -> Mission:
    """The mission once this trip replaces what was left of its plan; the price stays."""
    start_at = ms_to_moment(trip.start_ms)
    fresh = {eta.package_id: eta for eta in _etas(trip.plan, start_at)}
    return mission.model_copy(
        update={
            "revision": revision,
            "start_at": start_at,
            "released_at": ms_to_moment(trip.released_ms),
            "packages": tuple(fresh.get(eta.package_id, eta) for eta in mission.packages),
            "plan": trip.plan,
            "home_plan": trip.home_plan,
            "home_recharge": trip.home_recharge,
            "margins": margins,
            "given_up": None,
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
