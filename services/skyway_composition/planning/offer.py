"""An offer: the trips that would carry a request, with their prices and limits."""

from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Self

from skyway.contracts.candidate import Candidate, ProviderReason
from skyway.contracts.mission import OfferLimits, PackageEta
from skyway.contracts.quote import OfferTerms
from skyway.delivery.offer import BestValues, OfferValues, Price, Tariff, price_of, total_price
from skyway.delivery.plan import Fly, Plan, Recharge
from skyway.delivery.qos import QoS, Weights
from skyway.delivery.request import DeliveryRequest
from skyway.ids import ProviderId, StationId
from skyway.network.network import Network
from skyway.scheduling.trip import Trip
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.planning.availability import Opening
from skyway_composition.planning.problem_for import margins_of
from skyway_composition.planning.world import World

#: Milliseconds by which an offer's delivery time may be exceeded, because JSON rounds the time.
_OFFER_SLACK_MS = 1_000


@dataclass(frozen=True, slots=True)
class Part:
    """One drone's trip with the packages of `request`, and its price.

    `opening` is its place in the drone's calendar; None for a drone without missions.
    """

    candidate: Candidate
    trip: Trip
    request: DeliveryRequest
    distance_m: float
    price: Price
    opening: Opening | None = None

    @classmethod
    def of(
        cls,
        candidate: Candidate,
        trip: Trip,
        *,
        request: DeliveryRequest,
        network: Network,
        opening: Opening | None,
    ) -> "Part":
        """The part, priced by the candidate's tariff."""
        distance_m = distance_flown_m(network, trip.plan)
        price = price_of_plan(candidate.tariff, trip.plan, request, distance_m=distance_m)
        return cls(candidate, trip, request, distance_m, price, opening)


@dataclass(frozen=True, slots=True)
class Offer:
    """One provider's trips; their times count from `begins_ms`, the earliest start of any drone."""

    parts: tuple[Part, ...]
    begins_ms: int

    @property
    def provider_id(self) -> ProviderId:
        """The provider of the drones."""
        return self.parts[0].candidate.provider_id

    @property
    def price(self) -> Price:
        """The sum of the trips' prices."""
        return total_price([part.price for part in self.parts])

    @property
    def packages(self) -> int:
        """The number of packages that are carried."""
        return sum(len(part.request.packages) for part in self.parts)

    @property
    def values(self) -> OfferValues:
        """The values that ranking compares; the time is that of the last delivery of all trips."""
        return OfferValues(
            time_s=max(
                (part.trip.start_ms - self.begins_ms) / 1000
                + (part.trip.plan.delivery_time_s or 0.0)
                for part in self.parts
            ),
            price=sum(part.price.amount for part in self.parts),
            energy_j=sum(part.trip.plan.energy_j or 0.0 for part in self.parts),
            provider_id=self.provider_id,
            drone_id=self.parts[0].candidate.drone_id,
            no_shows=self.parts[0].candidate.no_shows,
        )


@dataclass(frozen=True, slots=True)
class Offers:
    """The offers, best first, and one reason for each provider without an offer."""

    ranked: tuple[Offer, ...]
    reasons: tuple[ProviderReason, ...]


def terms_of(offer: Offer, *, best: BestValues, weights: Weights, world: World) -> OfferTerms:
    """An offer as customers see it, scored relative to the best values of all offers."""
    values, first = offer.values, offer.parts[0]
    plans = [part.trip.plan for part in offer.parts]
    return OfferTerms(
        provider_id=values.provider_id,
        drone_id=values.drone_id,
        drone_model_id=first.candidate.model.model_id,
        price=offer.price,
        pooled_price=_pooled_price(offer),
        pickup_station_id=first.request.pickup.station_id,
        pickup_at=min(_pickup_at(part.trip) for part in offer.parts),
        delivery_time_s=values.time_s,
        packages=tuple(eta for part in offer.parts for eta in _etas(part.trip)),
        energy_j=values.energy_j,
        distance_m=sum(part.distance_m for part in offer.parts),
        recharges=sum(isinstance(step, Recharge) for plan in plans for step in plan.steps),
        recharging_s=sum(plan.recharging_s or 0.0 for plan in plans),
        waiting_s=sum(plan.waiting_s or 0.0 for plan in plans),
        trips=len(offer.parts),
        ways=tuple(_way(plan) for plan in plans),
        margins=margins_of(world, first.candidate, first.trip),
        weather=world.weather_note(offer.begins_ms),
        score=best.score(values, weights),
        no_shows=values.no_shows,
    )


def _pooled_price(offer: Offer) -> Price | None:
    """What the offer costs if all its trips are shared; None if the price would be the same."""
    if not all(part.request.may_share_trip for part in offer.parts):
        return None
    price = total_price([part.price.pooled(part.candidate.tariff) for part in offer.parts])
    return price if price.amount < offer.price.amount else None


def price_of_plan(
    tariff: Tariff, plan: Plan, request: DeliveryRequest, *, distance_m: float
) -> Price:
    """What a tariff asks for a request that is flown by this plan, over this distance."""
    return price_of(
        tariff,
        distance_m=distance_m,
        payload_kg=request.payload_kg,
        recharging_s=plan.recharging_s or 0.0,
        priority=request.qos.priority,
    )


def distance_flown_m(network: Network, plan: Plan) -> float:
    """The length of all segments that a plan flies, metres."""
    return sum(
        segment.length_m
        for step in plan.steps
        if isinstance(step, Fly)
        for segment in network.segments_from(step.from_id)
        if segment.to_id == step.to_id
    )


def _way(plan: Plan) -> tuple[StationId, ...]:
    """The stations that the packages of a plan pass, from the pickup to the last delivery."""
    flights = [
        step for step in plan.steps if isinstance(step, Fly) and step.start_s >= plan.pickup_s
    ]
    return (flights[0].from_id, *(flight.to_id for flight in flights)) if flights else ()


def _pickup_at(trip: Trip) -> datetime:
    """When the drone begins to load at the pickup."""
    return ms_to_moment(trip.start_ms) + timedelta(seconds=trip.plan.pickup_s)


def _etas(trip: Trip) -> list[PackageEta]:
    start_at = ms_to_moment(trip.start_ms)
    return [
        PackageEta(
            package_id=each.package_id, eta_at=start_at + timedelta(seconds=each.delivered_s)
        )
        for each in trip.plan.deliveries
    ]


@dataclass(frozen=True, slots=True)
class Limits:
    """The latest moment of the last delivery, and the highest price; None means no limit.

    `latest_ms` comes from the customer's deadline or from an offer that was accepted; only such a
    limit makes a plan TOO_LATE. Unless `is_whole`, packages may be left for later when there are
    too few drones.
    """

    latest_ms: int | None
    max_price: int | None
    is_whole: bool

    @classmethod
    def of(cls, qos: QoS, *, ceiling: int | None = None) -> Self:
        """The limits of a customer; with a highest price all packages are carried, or none.

        `ceiling` is the network's limit for customers who name no highest price.
        """
        latest_ms = None if qos.deadline_at is None else moment_to_ms(qos.deadline_at)
        max_price = ceiling if qos.max_price is None else qos.max_price
        return cls(latest_ms, max_price, is_whole=qos.max_price is not None)

    @classmethod
    def of_whole(cls, qos: QoS) -> Self:
        """The limits of a customer, for all packages or none."""
        return replace(cls.of(qos), is_whole=True)

    def within(self, offer: OfferLimits | None, *, start_ms: int) -> "Limits":
        """These limits together with those of an offer, for missions that begin at this moment."""
        if offer is None:
            return self
        latest_ms = start_ms + round(offer.within_s * 1000) + _OFFER_SLACK_MS
        amounts = (self.max_price, offer.price.amount)
        return Limits(
            latest_ms if self.latest_ms is None else min(self.latest_ms, latest_ms),
            min(each for each in amounts if each is not None),
            is_whole=True,
        )
