"""Plan offers: compose, price and rank, and collect why other providers make no offer."""

import asyncio
import math
from collections.abc import (
    AsyncIterator,
    Iterable,
    Mapping,
    Sequence,
)
from dataclasses import replace
from datetime import timedelta
from typing import Any, Final

import numpy as np

from skyway.contracts.candidate import Candidate, Possible, ProviderReason
from skyway.contracts.message import utc_text
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import rank_offers
from skyway.delivery.request import DeliveryRequest, Package
from skyway.ids import DroneId
from skyway.scheduling.trip import NoTrip, Trip
from skyway.units import ms_to_moment
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

    One drone carries everything if any drone can. Otherwise the packages are split over several
    drones of a provider.
    """
    refusals = Refusals()
    world = finder.world
    fit = fit_among(refusals, world, request, shortlist=shortlist, busy=busy, at_ms=finder.start_ms)
    if fit.is_empty:
        return Offers((), refusals.of_providers(()))
    offers: list[Offer] = []
    able = carrying_all(fit, request, world.skyway.settings)
    if not able.is_empty:
        _refuse_overweight(refusals, fit, request)
        offers = await _single_offers(finder, request, able, limits=limits, refusals=refusals)
        fit = refusals.without_plan(fit)
    if not offers and (able.is_empty or len(request.packages) > 1):
        offers = await split_offers(
            finder, request, fit.candidates, limits=limits, refusals=refusals
        )
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
    shortlist = shortlist.in_cold(finder.world.conditions.temperature_c(finder.start_ms))
    after_all, placed = replace(finder, openings=available.openings), available.placed(shortlist)
    offers = await plan_offers(
        after_all, request, shortlist=placed, busy=available.busy, limits=limits
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
    if not found:
        reasons = await with_possible(after_all, request, placed, offers.reasons)
        return replace(offers, reasons=reasons)
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
    least = LowerBounds.of(
        finder.world.skyway,
        request,
        shortlist,
        waits_s=waits_s,
        time_factors=finder.world.least_time_factors(shortlist.model_of),
        energy_margins=finder.world.energy_margins(shortlist),
    )
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


#: Of requests with more packages, the packages are not tried alone. Our own choice.
_MOST_ALONE: Final = 8

#: The loads that are tried, as shares of what the drone lifts.
_SHARES: Final = (1.0, 0.75, 0.5, 0.25)


async def with_possible(
    finder: TripFinder,
    request: DeliveryRequest,
    shortlist: Shortlist,
    reasons: tuple[ProviderReason, ...],
) -> tuple[ProviderReason, ...]:
    """The reasons with what would have been possible, unless asking again later may help."""
    if any(each.is_temporary for each in reasons):
        return reasons
    found: list[ProviderReason] = []
    for reason in reasons:
        own = [each for each in shortlist.candidates if each.provider_id == reason.provider_id]
        possible: list[Possible] = []
        if own and reason.code not in ("TOO_EXPENSIVE", "OTHER_CURRENCY"):
            strongest = max(own, key=lambda each: each.model.max_payload_kg)
            possible = [each async for each in _possible(finder, request, strongest)]
        words = "; ".join(["", *(f"possible: {each.detail}" for each in possible)])
        update = {"detail": reason.detail + words, "possible": tuple(possible)}
        found.append(reason.model_copy(update=update))
    return tuple(found)


async def _possible(
    finder: TripFinder, request: DeliveryRequest, drone: Candidate
) -> AsyncIterator[Possible]:
    """What this drone could do: some of the packages, less mass, or a later delivery."""

    async def trip(packages: Sequence[Package], **changes: Any) -> Trip | None:  # of the request
        other = request.model_copy(update={"packages": tuple(packages), **changes})
        # A finder keeps trips by their packages, and not by their deadline.
        own = replace(finder, latest_ms=None, _found={}) if changes else finder
        found = await own.trip(drone, other)
        return found if isinstance(found, Trip) else None

    packages, payload_kg = request.packages, request.payload_kg
    if 1 < len(packages) <= _MOST_ALONE:
        stuck = [each.package_id for each in packages if await trip([each]) is None]
        if 0 < len(stuck) < len(packages):
            detail = f"each other package alone, without {' and '.join(map(repr, stuck))}"
            yield Possible(kind="WITHOUT", detail=detail, package_ids=tuple(stuck))
    for share in _SHARES if payload_kg > 0 else ():
        left = share * min(drone.model.max_payload_kg / payload_kg, 1.0)
        # A gram less than the limit: masses add up with rounding.
        less_kg = math.ceil(payload_kg * (1.0 - left) * 1000 + 1) / 1000
        lighter = [
            each.model_copy(update={"mass_kg": each.mass_kg * (1.0 - less_kg / payload_kg)})
            for each in packages
        ]
        if left < 1.0 and less_kg < payload_kg and await trip(lighter) is not None:
            yield Possible(kind="LESS", detail=f"{less_kg:g} kg less", less_kg=less_kg)
            break
    if request.latest_at is not None:
        patient = [each.model_copy(update={"latest_at": None}) for each in packages]
        qos = request.qos.model_copy(update={"deadline_at": None})
        late = await trip(patient, latest_pickup_at=None, qos=qos)
        if late is not None and late.plan.delivery_time_s is not None:
            at_s = math.ceil(late.start_ms / 1000 + late.plan.delivery_time_s)
            at = ms_to_moment(0) + timedelta(seconds=at_s)
            yield Possible(kind="LATER", detail=f"delivered at {utc_text(at)}", at=at)
