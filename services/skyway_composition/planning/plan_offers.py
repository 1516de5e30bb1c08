"""Plan offers: compose, price and rank, and collect why other providers make no offer."""

import asyncio
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import rank_offers
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DroneId
from skyway.scheduling.trip import NoTrip
from skyway_composition.planning.availability import Availability
from skyway_composition.planning.contest import Contest
from skyway_composition.planning.find_trip import TripFinder
from skyway_composition.planning.lower_bounds import LowerBounds
from skyway_composition.planning.offer import Limits, Offer, Offers, Part
from skyway_composition.planning.refusals import Refusals, fit_among
from skyway_composition.planning.split import carrying_all, split_offers


async def plan_offers(
    finder: TripFinder,
    request: DeliveryRequest,
    *,
    shortlist: Shortlist,
    busy: Mapping[DroneId, int | None],
    limits: Limits,
) -> Offers:
    """The offers of candidates that may win, best first; the first is the best of all candidates.

    One drone carries everything if any drone can. Otherwise the request is split over several
    drones.
    """
    refusals = Refusals()
    world = finder.world
    fit = fit_among(refusals, world, request, shortlist=shortlist, busy=busy, at_ms=finder.start_ms)
    if fit.is_empty:
        return Offers((), refusals.of_providers(()))
    able = carrying_all(fit, request, world.skyway.settings)
    if able.is_empty:
        offers = await split_offers(
            finder, request, fit.candidates, limits=limits, refusals=refusals
        )
    else:
        _refuse_overweight(refusals, fit, request)
        offers = await _single_offers(finder, request, able, limits=limits, refusals=refusals)
    ranked = rank_offers([offer.values for offer in offers], request.qos.ranking)
    reasons = refusals.of_providers({offer.provider_id for offer in offers})
    return Offers(tuple(offers[index] for index in ranked), reasons)


async def plan_in_calendars(
    finder: TripFinder,
    request: DeliveryRequest,
    *,
    shortlist: Shortlist,
    available: Availability,
    gaps: Iterable[Availability],
    limits: Limits,
) -> Offers:
    """The offers after all that is booked, and in the gaps of calendars; best first.

    The first is the best of all candidates and openings. A provider has a reason if it has no offer
    after all that is booked either.
    """
    offers = await plan_offers(
        replace(finder, openings=available.openings),
        request,
        shortlist=available.placed(shortlist),
        busy=available.busy,
        limits=limits,
    )
    found = [*offers.ranked]
    for each in gaps:
        rows = [row for row, drone in enumerate(shortlist.drone_ids) if drone in each.openings]
        in_gaps = await plan_offers(
            replace(finder, openings=each.openings),
            request,
            shortlist=each.placed(shortlist.only(rows)),
            busy=each.busy,
            limits=limits,
        )
        found.extend(in_gaps.ranked)
    if len(found) == len(offers.ranked):
        return offers
    ranked = rank_offers([offer.values for offer in found], request.qos.ranking)
    offering = {offer.provider_id for offer in found}
    reasons = tuple(each for each in offers.reasons if each.provider_id not in offering)
    return Offers(tuple(found[index] for index in ranked), reasons)


async def best_of_each(
    finder: TripFinder,
    request: DeliveryRequest,
    *,
    shortlist: Shortlist,
    available: Availability,
    gaps: Sequence[Availability],
    limits: Limits,
) -> Offers:
    """The best offer of each provider, best first."""
    found = await asyncio.gather(
        *(
            plan_in_calendars(
                finder,
                request,
                shortlist=shortlist.of_provider(provider_id),
                available=available,
                gaps=gaps,
                limits=limits,
            )
            for provider_id in sorted(set(shortlist.provider_ids))
        )
    )
    best = [offers.ranked[0] for offers in found if offers.ranked]
    ranked = rank_offers([offer.values for offer in best], request.qos.ranking)
    reasons = tuple(reason for offers in found for reason in offers.reasons)
    return Offers(tuple(best[index] for index in ranked), reasons)


async def _single_offers(
    finder: TripFinder,
    request: DeliveryRequest,
    shortlist: Shortlist,
    *,
    limits: Limits,
    refusals: Refusals,
) -> list[Offer]:
    """Compose for the candidates that may win, the most promising first."""
    waits_s = finder.waits_s(shortlist.drone_ids)
    least = LowerBounds.of(finder.world.skyway, request, shortlist, waits_s=waits_s)
    contest = Contest(shortlist, least, request.qos.ranking, openings=finder.openings)
    contest.leave_out(_breaking(shortlist, least, finder, limits=limits, refusals=refusals))
    offers: list[Offer] = []
    while twins := contest.next_to_compose([offer.values for offer in offers]):
        candidates = [shortlist.candidate(row) for row in twins]
        trip = await finder.trip(candidates[0], request)
        for candidate in candidates:
            if isinstance(trip, NoTrip):
                # A drone that is busy now may be free earlier or elsewhere than its calendar says.
                is_temporary = trip.is_temporary or candidate.drone_id in finder.openings
                reason = replace(trip, is_temporary=is_temporary)
                refusals.add_no_trip(candidate.provider_id, reason)
                continue
            part = Part.of(
                candidate,
                trip,
                request=request,
                network=finder.world.skyway.network,
                opening=finder.openings.get(candidate.drone_id),
            )
            offer = Offer((part,), finder.start_ms)
            if refusals.is_affordable(offer, limits):
                offers.append(offer)
    return offers


def _breaking(
    shortlist: Shortlist,
    least: LowerBounds,
    finder: TripFinder,
    *,
    limits: Limits,
    refusals: Refusals,
) -> list[int]:
    """The rows whose lower bounds break a limit; their reasons are added to `refusals`."""
    latest_s = math.inf
    if limits.latest_ms is not None:
        latest_s = (limits.latest_ms - finder.start_ms) / 1000
    max_price = math.inf if limits.max_price is None else limits.max_price
    # With a tolerance: bounds and plans add up their floats in different orders.
    is_late = (latest_s + 1 < least.time_s) & (least.time_s < math.inf)
    is_dear = least.price > max_price + 1
    breaking: list[int] = np.flatnonzero(is_late | is_dear).tolist()
    for row in breaking:
        provider_id = shortlist.provider_ids[row]
        if is_late[row]:
            least_s = float(least.time_s[row])
            refusals.add(
                provider_id,
                "TOO_LATE",
                f"it takes at least {least_s:.0f} s, the limit is {latest_s:.0f} s",
                is_temporary=shortlist.drone_ids[row] in finder.openings,
                least_s=least_s,
                latest_s=latest_s,
            )
        else:
            least_price = int(least.price[row])
            refusals.add(
                provider_id,
                "TOO_EXPENSIVE",
                f"it costs at least {least_price}, which exceeds the limit of {max_price}",
                is_temporary=False,
                least_price=least_price,
                max_price=max_price,
            )
    return breaking


def _refuse_overweight(refusals: Refusals, shortlist: Shortlist, request: DeliveryRequest) -> None:
    """Add a reason for each drone that cannot lift the payload."""
    payload_kg = request.payload_kg
    for provider_id, model_id in zip(shortlist.provider_ids, shortlist.model_ids, strict=True):
        limit_kg = shortlist.model_of[model_id].max_payload_kg
        if limit_kg < payload_kg:
            refusals.add(
                provider_id,
                "OVERWEIGHT",
                f"payload {payload_kg:g} kg exceeds the {limit_kg:g} kg limit of drone model "
                f"{model_id}",
                is_temporary=False,
                mass_kg=payload_kg,
                limit_kg=limit_kg,
            )
