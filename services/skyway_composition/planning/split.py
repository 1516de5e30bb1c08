"""Split a request that no single trip can carry over several drones of one provider.

The drones take loads of the sweep in turn, the strongest drone first. Where a drone has no trip
with all that it lifts, it is tried with less; so the loads fit range, charge, windows and pads.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, groupby
from typing import Final

from skyway.contracts.candidate import Candidate, Possible
from skyway.contracts.network_document import NetworkSettings
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import rank_offers
from skyway.delivery.request import DeliveryRequest, Package
from skyway.geo import bearing_rad
from skyway.network.network import Network
from skyway.scheduling.trip import NoTrip
from skyway_composition.planning.find_trip import TripFinder
from skyway_composition.planning.offer import Limits, Offer, Part
from skyway_composition.planning.refusals import Refusals

#: The most trips that are planned for one request with the drones of one provider, beside one for
#: each drone. Our own choice: about 0.3 s in a city.
MOST_TRIPS: Final = 32

#: Of so many packages all divisions are tried; of more, loads of the sweep.
_FEW: Final = 3


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
        strongest_first = sorted(own, key=lambda each: -each.model.max_payload_kg)
        division = _Division(finder, request, strongest_first)
        offer = await division.best(limits, refusals)
        if offer is not None:
            offers.append(offer)
    most = max((offer.packages for offer in offers), default=0)
    return [offer for offer in offers if offer.packages == most]


@dataclass(slots=True)
class _Division:
    """The search for the best way to divide a request among one provider's drones.

    Sorting has kept the registry's order among equally strong drones: the nearest first.
    """

    finder: TripFinder
    request: DeliveryRequest
    candidates: Sequence[Candidate]
    asked: int = 0
    #: The ways to carry everything, and the way with the most packages.
    whole: list[tuple[Part, ...]] = field(default_factory=list)
    most: tuple[Part, ...] = ()

    async def best(self, limits: Limits, refusals: Refusals) -> Offer | None:
        """The offer that the customer wants most; if there is none, the reason is added."""
        network = self.finder.world.skyway.network
        await self._carry(_swept(network, self.request), self.candidates, ())
        offers = [Offer(parts, self.finder.start_ms) for parts in self.whole]
        for index in rank_offers([each.values for each in offers], self.request.qos.ranking):
            if refusals.is_affordable(offers[index], limits):
                return offers[index]
        if offers:
            return None
        carried = {each.package_id for part in self.most for each in part.request.packages}
        left = [each for each in self.request.packages if each.package_id not in carried]
        for package in left:
            if (reason := await self._never_alone(package)) is not None:
                refusals.add_no_trip(self.candidates[0].provider_id, reason)
                return None
        if self.most and not limits.is_whole:
            offer = Offer(self.most, self.finder.start_ms)
            return offer if refusals.is_affordable(offer, limits) else None
        ids = tuple(each.package_id for each in left)
        detail = f"{' and '.join(map(repr, ids))} apart, each in a request of its own"
        apart = Possible(kind="APART", detail=detail, package_ids=ids)
        refusals.add(
            self.candidates[0].provider_id,
            "NOT_ENOUGH_DRONES",
            f"its {len(self.most)} free drones leave {len(left)} packages behind",
            is_temporary=True,
            possible=[] if self._is_over else [apart],
            drones=len(self.most),
            packages_left=len(left),
        )
        return None

    @property
    def _is_over(self) -> bool:
        return self.asked >= MOST_TRIPS + len(self.candidates)

    async def _carry(
        self, left: Sequence[Package], free: Sequence[Candidate], parts: tuple[Part, ...]
    ) -> None:
        """Keep the ways to carry what is left with these drones, beside the trips so far."""
        if not left:
            self.whole.append(parts)
            return
        if sum(len(each.request.packages) for each in parts) > sum(
            len(each.request.packages) for each in self.most
        ):
            self.most = parts
        tried: set[object] = set()
        most_stops = self.finder.world.skyway.settings.max_destinations_per_trip
        for candidate in free:
            kind = self.finder.flies_like(candidate)
            if kind in tried:
                continue
            tried.add(kind)
            others = [each for each in free if each is not candidate]
            for load in _loads(left, candidate, most_stops=most_stops):
                if self._is_over:
                    return
                part = await self._part(candidate, load, parts)
                if part is not None:
                    rest = [each for each in left if each not in load]
                    await self._carry(rest, others, (*parts, part))

    async def _part(
        self, candidate: Candidate, load: Sequence[Package], parts: tuple[Part, ...]
    ) -> Part | None:
        self.asked += 1
        request = self.request.model_copy(update={"packages": tuple(load)})
        held = sorted(pad for part in parts for pad in part.trip.booked_pads)
        trip = await self.finder.trip(candidate, request, held=held)
        if isinstance(trip, NoTrip):
            return None
        opening = self.finder.openings.get(candidate.drone_id)
        network = self.finder.world.skyway.network
        return Part.of(candidate, trip, request=request, network=network, opening=opening)

    async def _never_alone(self, package: Package) -> NoTrip | None:
        """The reason why no drone carries this package, even alone; None if one may."""
        request = self.request.model_copy(update={"packages": (package,)})
        found: NoTrip | None = None
        for candidate in self.candidates:
            if package.mass_kg > candidate.model.max_payload_kg:
                continue
            if self._is_over:
                return None
            self.asked += 1
            trip = await self.finder.trip(candidate, request)
            if not isinstance(trip, NoTrip):
                return None
            is_temporary = trip.is_temporary or candidate.drone_id in self.finder.openings
            if found is None or is_temporary:
                found = replace(trip, is_temporary=is_temporary)
        return found or _too_heavy(package, self.candidates[0])


def _too_heavy(package: Package, strongest: Candidate) -> NoTrip:
    limit_kg = strongest.model.max_payload_kg
    return NoTrip(
        "OVERWEIGHT",
        f"a package of {package.mass_kg:g} kg exceeds the {limit_kg:g} kg limit of drone model "
        f"{strongest.model.model_id}",
        is_temporary=False,
        data=(("mass_kg", package.mass_kg), ("limit_kg", limit_kg)),
    )


def _loads(
    left: Sequence[Package], candidate: Candidate, *, most_stops: int
) -> Iterator[list[Package]]:
    """The loads with which this drone is tried: all that it lifts, then less and less."""
    most = _next_load(left, candidate, most_stops=most_stops)
    if most:
        yield most
    if len(left) > _FEW:
        while len(most) > 1:
            most = most[: len(most) // 2]
            yield most
        return
    for size in range(len(left), 0, -1):
        for load in combinations(left, size):
            fits = _next_load(load, candidate, most_stops=most_stops)
            if len(fits) == size and fits != most:
                yield fits


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
