"""What would have been possible instead of a request that no drone can fly, tried with the planner.

Only a final rejection is worth these plans, at most 13 for each provider.
"""

import math
from collections.abc import AsyncIterator, Sequence
from dataclasses import replace
from datetime import timedelta
from typing import Any, Final

from skyway.contracts.candidate import Candidate, Possible, ProviderReason
from skyway.contracts.message import utc_text
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.request import DeliveryRequest, Package
from skyway.scheduling.trip import Trip
from skyway.units import ms_to_moment
from skyway_composition.planning.find_trip import TripFinder

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
