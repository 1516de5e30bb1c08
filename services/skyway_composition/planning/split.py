"""Split a request that no single trip can carry over several drones of one provider."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby

from skyway.contracts.candidate import Candidate
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.request import DeliveryRequest, Package
from skyway.geo import bearing_rad
from skyway.network.network import Network
from skyway.scheduling.trip import BookedPad, NoTrip
from skyway_composition.networks.settings import NetworkSettings
from skyway_composition.planning.find_trip import TripFinder
from skyway_composition.planning.offer import Limits, Offer, Part
from skyway_composition.planning.refusals import Refusals


def carrying_all(
    shortlist: Shortlist, request: DeliveryRequest, settings: NetworkSettings
) -> Shortlist:
    """The candidates that may carry all packages of the request in one trip."""
    if len(request.destinations) > settings.max_destinations_per_trip:
        return shortlist.only([])
    able = {
        model_id
        for model_id, model in shortlist.model_of.items()
        if request.payload_kg <= model.max_payload_kg
    }
    return shortlist.only([row for row, of in enumerate(shortlist.model_ids) if of in able])


async def split_offers(
    finder: TripFinder,
    request: DeliveryRequest,
    candidates: Sequence[Candidate],
    *,
    limits: Limits,
    refusals: Refusals,
) -> list[Offer]:
    """One offer of each provider that can carry everything in several trips.

    When no provider can, and packages may be left for later, the offers with the most packages.
    """
    offers: list[Offer] = []
    for _, own in groupby(
        sorted(candidates, key=lambda each: each.provider_id), lambda each: each.provider_id
    ):
        offer = await _split(finder, request, list(own), limits=limits, refusals=refusals)
        if offer is not None and refusals.is_affordable(offer, limits):
            offers.append(offer)
    most = max((offer.packages for offer in offers), default=0)
    return [offer for offer in offers if offer.packages == most]


@dataclass(slots=True)
class _Split:
    """The trips found so far, and the packages without a trip, in sweep order."""

    left: list[Package]
    parts: list[Part] = field(default_factory=list)
    #: The last drone without a trip, and the reason.
    obstacle: tuple[Candidate, NoTrip] | None = None

    @property
    def held(self) -> tuple[BookedPad, ...]:
        """The pads that the trips found so far will hold."""
        return tuple(sorted(pad for part in self.parts for pad in part.trip.booked_pads))


async def _split(
    finder: TripFinder,
    request: DeliveryRequest,
    candidates: Sequence[Candidate],
    *,
    limits: Limits,
    refusals: Refusals,
) -> Offer | None:
    """The trips of one provider's drones, the strongest first, each with the sweep's next load."""
    skyway = finder.world.skyway
    split = _Split(_swept(skyway.network, request))
    # Sorting keeps the registry's order among equals: the nearest first.
    for candidate in sorted(candidates, key=lambda each: -each.model.max_payload_kg):
        taken = _next_load(
            split.left, candidate, most_stops=skyway.settings.max_destinations_per_trip
        )
        if not taken:
            continue
        part_request = request.model_copy(update={"packages": tuple(taken)})
        trip = await finder.trip(candidate, part_request, held=split.held)
        if isinstance(trip, NoTrip):
            is_temporary = trip.is_temporary or candidate.drone_id in finder.openings
            split.obstacle = candidate, replace(trip, is_temporary=is_temporary)
            continue
        opening = finder.openings.get(candidate.drone_id)
        part = Part.of(
            candidate, trip, request=part_request, network=skyway.network, opening=opening
        )
        split.parts.append(part)
        gone = {each.package_id for each in taken}
        split.left = [each for each in split.left if each.package_id not in gone]
        if not split.left:
            break
    if split.parts and not (split.left and limits.is_whole):
        return Offer(tuple(split.parts), finder.start_ms)
    _refuse(refusals, split, candidates)
    return None


def _swept(network: Network, request: DeliveryRequest) -> list[Package]:
    """The packages in order of their destinations' bearings, starting after the widest gap."""
    centre = network.stations[request.pickup.station_id].position

    def bearing(package: Package) -> tuple[float, str]:
        station_id = package.destination.station_id
        return bearing_rad(centre, network.stations[station_id].position), station_id

    swept = sorted(request.packages, key=bearing)
    angles = [bearing(package)[0] for package in swept]
    gaps = [
        (after - before) % math.tau
        for before, after in zip(angles[-1:] + angles[:-1], angles, strict=True)
    ]
    first = gaps.index(max(gaps)) if len(swept) > 1 else 0
    return swept[first:] + swept[:first]


def _next_load(left: Sequence[Package], candidate: Candidate, *, most_stops: int) -> list[Package]:
    """The next packages of the sweep that this drone can carry; others are skipped."""
    taken: list[Package] = []
    stops: set[str] = set()
    for package in left:
        load_kg = math.fsum([*(each.mass_kg for each in taken), package.mass_kg])
        more_stops = stops | {package.destination.station_id}
        if load_kg <= candidate.model.max_payload_kg and len(more_stops) <= most_stops:
            taken.append(package)
            stops = more_stops
    return taken


def _refuse(refusals: Refusals, split: _Split, candidates: Sequence[Candidate]) -> None:
    """Add the reason why a provider's drones cannot carry everything."""
    strongest = max(candidates, key=lambda each: each.model.max_payload_kg)
    heaviest_kg = max(package.mass_kg for package in split.left)
    limit_kg = strongest.model.max_payload_kg
    if heaviest_kg > limit_kg:
        refusals.add(
            strongest.provider_id,
            "OVERWEIGHT",
            f"a package of {heaviest_kg:g} kg exceeds the {limit_kg:g} kg limit of drone model "
            f"{strongest.model.model_id}",
            is_temporary=False,
            mass_kg=heaviest_kg,
            limit_kg=limit_kg,
        )
    elif split.obstacle is not None:
        candidate, reason = split.obstacle
        refusals.add_no_trip(candidate.provider_id, reason)
    else:
        refusals.add(
            strongest.provider_id,
            "NOT_ENOUGH_DRONES",
            f"its {len(split.parts)} free drones leave {len(split.left)} packages behind",
            is_temporary=True,
            drones=len(split.parts),
            packages_left=len(split.left),
        )
