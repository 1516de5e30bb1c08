"""Offers: every candidate's true plan, priced and ranked, and why the others make none."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby

from skyway.contracts.candidate import Candidate, ProviderReason, ProviderReasonCode
from skyway.delivery.offer import OfferValues, Price, price_of, rank_offers
from skyway.delivery.plan import Fly, Plan
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DroneId, ProviderId, StationId
from skyway.network.network import Network
from skyway.units import moment_to_ms
from skyway_composition.planning.least_time import least_delivery_s
from skyway_composition.planning.problem_for import Standing, delivery_problem
from skyway_composition.planning.round_trip import NoTrip, round_trip
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.trip import Trip
from skyway_composition.planning.world import World


@dataclass(frozen=True, slots=True)
class Offer:
    """One candidate's trip and what its provider asks for it."""

    candidate: Candidate
    trip: Trip
    price: Price


@dataclass(frozen=True, slots=True)
class Offers:
    """The offers, best first, and one reason of each provider that makes none."""

    ranked: tuple[Offer, ...]
    reasons: tuple[ProviderReason, ...]


@dataclass(frozen=True, slots=True)
class _Twins:
    """Candidates with the same plan: same model, place, charge and home."""

    candidates: tuple[Candidate, ...]
    least_s: float

    @property
    def first(self) -> Candidate:
        return self.candidates[0]


async def make_offers(
    solver: SolverPool,
    world: World,
    request: DeliveryRequest,
    *,
    candidates: Sequence[Candidate],
    busy: frozenset[DroneId],
    start_ms: int,
) -> Offers:
    """Compose for every candidate that may still win, and rank what comes out.

    When only time counts, candidates whose least possible time cannot beat the best plan so far
    are not composed: the best offer is certain without them.
    """
    refusals = _Refusals()
    fit = [each for each in candidates if refusals.is_fit(each, world, request, busy)]
    weights = request.qos.ranking
    only_time_counts = weights.price == 0 and weights.energy == 0
    offers: list[Offer] = []
    best_s: float | None = None
    for twins in _twins(world, request, fit):
        if only_time_counts and best_s is not None and twins.least_s >= best_s:
            break
        trip = await _trip_of(solver, world, request, twins.first, start_ms)
        for candidate in twins.candidates:
            offer = refusals.offer(candidate, trip, world, request)
            if offer is not None:
                offers.append(offer)
                time_s = offer.trip.plan.delivery_time_s or 0.0
                best_s = time_s if best_s is None else min(best_s, time_s)
    ranked = rank_offers([_values(offer) for offer in offers], weights)
    return Offers(tuple(offers[index] for index in ranked), refusals.of_providers(offers))


async def _trip_of(
    solver: SolverPool,
    world: World,
    request: DeliveryRequest,
    candidate: Candidate,
    start_ms: int,
) -> Trip | NoTrip:
    deadline_at = request.qos.deadline_at
    latest_ms = None if deadline_at is None else moment_to_ms(deadline_at)
    if latest_ms is not None and latest_ms < start_ms:
        detail = f"the deadline {deadline_at} lies before the earliest start"
        return NoTrip("TOO_LATE", detail, is_temporary=False)
    problem = delivery_problem(
        world,
        Standing(candidate.model, candidate.soc, candidate.station_id),
        pickup=request.pickup.station_id,
        packages=request.packages,
        start_ms=start_ms,
        latest_ms=latest_ms,
    )
    return await round_trip(solver, world, problem, home_station_id=candidate.home_station_id)


def _twins(world: World, request: DeliveryRequest, candidates: Iterable[Candidate]) -> list[_Twins]:
    """The candidates in groups to be composed once, the potentially fastest first."""

    def same_plan(candidate: Candidate) -> tuple[str, str, float, str]:
        model = candidate.model.model_dump_json()
        return model, candidate.station_id, candidate.soc, candidate.home_station_id

    groups = [tuple(group) for _, group in groupby(sorted(candidates, key=same_plan), same_plan)]
    twins = [
        _Twins(
            group,
            least_delivery_s(
                world.skyway, request, model=group[0].model, station_id=group[0].station_id
            ),
        )
        for group in groups
    ]
    return sorted(twins, key=lambda each: each.least_s)


class _Refusals:
    """Collects why candidates make no offer."""

    def __init__(self) -> None:
        self._reasons: list[ProviderReason] = []

    def is_fit(
        self,
        candidate: Candidate,
        world: World,
        request: DeliveryRequest,
        busy: frozenset[DroneId],
    ) -> bool:
        """Whether it is worth composing for this candidate; if not, the reason is kept."""
        known = world.skyway.network.stations
        places: list[StationId] = [request.pickup.station_id, *request.destinations]
        missing = [place for place in (candidate.station_id, *places) if place not in known]
        if missing:
            detail = f"station {missing[0]!r} is not in network {world.skyway.network_id!r}"
            self._add(candidate, "DESTINATION_UNREACHABLE", detail, is_temporary=False)
        elif candidate.drone_id in busy:
            self._add(candidate, "BUSY", "its drones are on missions", is_temporary=True)
        elif candidate.soc < candidate.model.reserve_soc:
            detail = f"charge {candidate.soc:.3f} is below the reserve"
            self._add(candidate, "LOW_CHARGE", detail, is_temporary=True)
        elif candidate.tariff.currency != world.skyway.settings.currency:
            detail = (
                f"its tariff is in {candidate.tariff.currency}, prices in this network are in "
                f"{world.skyway.settings.currency}"
            )
            self._add(candidate, "OTHER_CURRENCY", detail, is_temporary=False)
        else:
            return True
        return False

    def offer(
        self, candidate: Candidate, trip: Trip | NoTrip, world: World, request: DeliveryRequest
    ) -> Offer | None:
        """The candidate's offer, unless there is no trip or it costs too much."""
        if isinstance(trip, NoTrip):
            self._add(candidate, trip.code, trip.detail, is_temporary=trip.is_temporary)
            return None
        price = price_of(
            candidate.tariff,
            distance_m=distance_flown_m(world.skyway.network, trip.plan),
            payload_kg=request.payload_kg,
            recharging_s=trip.plan.recharging_s or 0.0,
        )
        limit = request.qos.max_price
        if limit is not None and price.amount > limit:
            detail = f"price {price.amount} exceeds the limit of {limit} {price.currency}"
            self._add(candidate, "TOO_EXPENSIVE", detail, is_temporary=False)
            return None
        return Offer(candidate, trip, price)

    def of_providers(self, offers: Iterable[Offer]) -> tuple[ProviderReason, ...]:
        """One reason per provider without offer; what may pass tells more than what stays."""
        with_offer = {offer.candidate.provider_id for offer in offers}
        told: dict[ProviderId | None, ProviderReason] = {}
        for reason in self._reasons:
            known = told.get(reason.provider_id)
            if known is None or (reason.is_temporary and not known.is_temporary):
                told[reason.provider_id] = reason
        return tuple(reason for provider, reason in told.items() if provider not in with_offer)

    def _add(
        self, candidate: Candidate, code: ProviderReasonCode, detail: str, *, is_temporary: bool
    ) -> None:
        self._reasons.append(
            ProviderReason(
                provider_id=candidate.provider_id,
                code=code,
                detail=detail,
                is_temporary=is_temporary,
            )
        )


def distance_flown_m(network: Network, plan: Plan) -> float:
    """The length of all segments that a plan flies."""
    return sum(
        segment.length_m
        for step in plan.steps
        if isinstance(step, Fly)
        for segment in network.segments_from(step.from_id)
        if segment.to_id == step.to_id
    )


def _values(offer: Offer) -> OfferValues:
    plan = offer.trip.plan
    return OfferValues(
        time_s=plan.delivery_time_s or 0.0,
        price=offer.price.amount,
        energy_j=plan.energy_j or 0.0,
        provider_id=offer.candidate.provider_id,
        drone_id=offer.candidate.drone_id,
    )
