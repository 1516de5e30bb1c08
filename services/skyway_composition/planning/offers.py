"""Offers: true plans, priced and ranked, and why the other providers make none."""

import asyncio
from collections.abc import Sequence
from itertools import groupby

from skyway.contracts.candidate import Candidate
from skyway.delivery.offer import rank_offers
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DroneId
from skyway_composition.planning.contest import Twins, next_to_compose, twins_among
from skyway_composition.planning.least import Least
from skyway_composition.planning.limits import Limits
from skyway_composition.planning.offer import Offer, Offers, Part
from skyway_composition.planning.refusals import Refusals, fit_candidates
from skyway_composition.planning.round_trip import NoTrip
from skyway_composition.planning.trip_finder import TripFinder
from skyway_composition.planning.trips import carrying_all, split_offers


async def plan_offers(
    finder: TripFinder,
    request: DeliveryRequest,
    *,
    candidates: Sequence[Candidate],
    busy: frozenset[DroneId],
    limits: Limits,
) -> Offers:
    """The offers of those who may win, best first; the first is what no pruning would change.

    Who can carry everything at once does; only when nobody can is the request split over trips.
    """
    refusals = Refusals()
    world = finder.world
    fit = fit_candidates(
        refusals, world, request, candidates=candidates, busy=busy, at_ms=finder.start_ms
    )
    if not fit:
        return Offers((), refusals.of_providers(()))
    settings = world.skyway.settings
    able = carrying_all(fit, request, settings)
    if able:
        payload_kg = request.payload_kg
        for each in fit:
            if each.model.max_payload_kg < payload_kg:
                _refuse_overweight(refusals, each, request)
        offers = await _single_offers(finder, request, able, limits=limits, refusals=refusals)
    else:
        offers = await split_offers(finder, request, fit, limits=limits, refusals=refusals)
    ranked = rank_offers([offer.values for offer in offers], request.qos.ranking)
    reasons = refusals.of_providers({offer.provider_id for offer in offers})
    return Offers(tuple(offers[index] for index in ranked), reasons)


async def best_of_each(
    finder: TripFinder,
    request: DeliveryRequest,
    *,
    candidates: Sequence[Candidate],
    busy: frozenset[DroneId],
    limits: Limits,
) -> Offers:
    """The best offer of each provider, best first; providers are compared by true plans, too."""
    by_provider = sorted(candidates, key=lambda each: each.provider_id)
    found = await asyncio.gather(
        *(
            plan_offers(finder, request, candidates=tuple(own), busy=busy, limits=limits)
            for _, own in groupby(by_provider, key=lambda each: each.provider_id)
        )
    )
    best = [offers.ranked[0] for offers in found if offers.ranked]
    ranked = rank_offers([offer.values for offer in best], request.qos.ranking)
    reasons = tuple(reason for offers in found for reason in offers.reasons)
    return Offers(tuple(best[index] for index in ranked), reasons)


async def _single_offers(
    finder: TripFinder,
    request: DeliveryRequest,
    candidates: Sequence[Candidate],
    *,
    limits: Limits,
    refusals: Refusals,
) -> list[Offer]:
    """Compose for the candidates that may still win, the most promising first."""
    least = Least.of(finder.world.skyway, request, candidates)
    waiting = [
        twins
        for twins in twins_among(candidates, least)
        if not _breaks_limits(twins, finder, limits, refusals)
    ]
    offers: list[Offer] = []
    while True:
        values = [offer.values for offer in offers]
        twins = next_to_compose(waiting, values, request.qos.ranking)
        if twins is None:
            return offers
        waiting.remove(twins)
        trip = await finder.trip(twins.candidates[0], request)
        for candidate in twins.candidates:
            if isinstance(trip, NoTrip):
                refusals.add_no_trip(candidate, trip)
                continue
            part = Part.of(candidate, trip, request=request, network=finder.world.skyway.network)
            offer = Offer((part,))
            if refusals.is_affordable(offer, limits):
                offers.append(offer)


def _breaks_limits(twins: Twins, finder: TripFinder, limits: Limits, refusals: Refusals) -> bool:
    """Whether none of these candidates can keep the limits, whatever is composed."""
    kept = 0
    for candidate, least in zip(twins.candidates, twins.least, strict=True):
        latest_s = None if limits.latest_ms is None else (limits.latest_ms - finder.start_ms) / 1000
        # Not by a hair: bounds are sums of floats, in another order than plans are.
        if latest_s is not None and latest_s + 1 < least.time_s < float("inf"):
            refusals.add(
                candidate,
                "TOO_LATE",
                f"it takes {least.time_s:.0f} s at least, of which there are {latest_s:.0f}",
                is_temporary=False,
                least_s=least.time_s,
                latest_s=latest_s,
            )
        elif limits.max_price is not None and least.price > limits.max_price + 1:
            refusals.add(
                candidate,
                "TOO_EXPENSIVE",
                f"it costs {least.price} at least, which exceeds the limit of {limits.max_price}",
                is_temporary=False,
                least_price=least.price,
                max_price=limits.max_price,
            )
        else:
            kept += 1
    return kept == 0


def _refuse_overweight(refusals: Refusals, candidate: Candidate, request: DeliveryRequest) -> None:
    limit_kg = candidate.model.max_payload_kg
    refusals.add(
        candidate,
        "OVERWEIGHT",
        f"payload {request.payload_kg:g} kg exceeds the {limit_kg:g} kg limit of drone model "
        f"{candidate.model.model_id}",
        is_temporary=False,
        mass_kg=request.payload_kg,
        limit_kg=limit_kg,
    )
