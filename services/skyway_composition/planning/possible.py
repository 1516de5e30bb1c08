"""What would have been possible instead of a request that no drone can fly, tried with the planner.

Only a final rejection is worth these plans: `MOST_TRIPS` for each provider at most.
"""

import math
from collections.abc import AsyncIterator
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.candidate import Candidate, Possible, ProviderReason
from skyway.contracts.message import utc_text
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.request import DeliveryRequest
from skyway.scheduling.trip import Trip
from skyway.units import ms_to_moment
from skyway_composition.planning.find_trip import TripFinder

#: The most trips that are planned for the answer to one provider. Our own choice.
MOST_TRIPS: Final = 16

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
        own = shortlist.of_provider(reason.provider_id) if reason.provider_id else None
        if own is None or own.is_empty or reason.code in ("TOO_EXPENSIVE", "OTHER_CURRENCY"):
            found.append(reason)
            continue
        strongest = max(own.candidates, key=lambda each: each.model.max_payload_kg)
        possible = [each async for each in _tried(finder, request, strongest)]
        words = "; ".join(each.detail for each in possible)
        detail = f"{reason.detail}; possible: {words}" if possible else reason.detail
        found.append(reason.model_copy(update={"detail": detail, "possible": tuple(possible)}))
    return tuple(found)


async def _tried(
    finder: TripFinder, request: DeliveryRequest, drone: Candidate
) -> AsyncIterator[Possible]:
    """What this drone could do: some of the packages, less mass, or a later delivery."""
    alone = []
    if 1 < len(request.packages) <= MOST_TRIPS // 2:
        for package in request.packages:
            only = request.model_copy(update={"packages": (package,)})
            alone.append(isinstance(await finder.trip(drone, only), Trip))
    in_the_way = tuple(
        each.package_id
        for each, can_fly in zip(request.packages, alone, strict=False)
        if not can_fly
    )
    if any(alone) and in_the_way:
        names = " and ".join(map(repr, in_the_way))
        detail = f"each of the others alone, without {names}"
        yield Possible(kind="WITHOUT", detail=detail, package_ids=in_the_way)
    for share in _SHARES:
        limit_kg = share * min(drone.model.max_payload_kg, request.payload_kg)
        if 0 < limit_kg < request.payload_kg and await _flies(finder, request, drone, limit_kg):
            less_kg = math.ceil((request.payload_kg - limit_kg) * 1000) / 1000
            yield Possible(kind="LESS", detail=f"{less_kg:g} kg less", less_kg=less_kg)
            break
    if request.latest_at is not None and (at := await _at_any_time(finder, request, drone)):
        yield Possible(kind="LATER", detail=f"delivered at {utc_text(at)}", at=at)


async def _flies(
    finder: TripFinder, request: DeliveryRequest, drone: Candidate, limit_kg: float
) -> bool:
    """Whether the drone flies the request with packages that weigh so much together."""
    share = limit_kg / request.payload_kg * (1 - 1e-9)
    lighter = [
        each.model_copy(update={"mass_kg": each.mass_kg * share}) for each in request.packages
    ]
    lighter_request = request.model_copy(update={"packages": tuple(lighter)})
    return isinstance(await finder.trip(drone, lighter_request), Trip)


async def _at_any_time(
    finder: TripFinder, request: DeliveryRequest, drone: Candidate
) -> datetime | None:
    """When the last package is delivered without a deadline and ends of windows."""
    packages = [each.model_copy(update={"latest_at": None}) for each in request.packages]
    patient = request.model_copy(
        update={
            "packages": tuple(packages),
            "latest_pickup_at": None,
            "qos": request.qos.model_copy(update={"deadline_at": None}),
        }
    )
    # Trips are kept by their packages, and not by their deadline.
    trip = await replace(finder, latest_ms=None, _found={}).trip(drone, patient)
    if not isinstance(trip, Trip) or trip.plan.delivery_time_s is None:
        return None
    delivered_s = math.ceil(trip.start_ms / 1000 + trip.plan.delivery_time_s)
    return ms_to_moment(0) + timedelta(seconds=delivered_s)
