"""Serves the places of a request: locates each place, and finds the open stations near it.

All of it happens in the gateway, with the stations that it has cached: no other service learns
where a customer lives. Composition is only asked which of the stations are closed.
"""

import asyncio
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from skyway.contracts.station_check import StationCheckQuery
from skyway.errors import InvalidInput
from skyway.geo import Position
from skyway.ids import StationId
from skyway.runtime.errors import Conflict
from skyway_gateway.clients import Composition
from skyway_gateway.places.choose import Candidate, chosen_walks
from skyway_gateway.places.customer_request import CustomerPlace, CustomerRequest
from skyway_gateway.places.geocoder import FoundPlace
from skyway_gateway.places.locate import Locator, swapped
from skyway_gateway.places.served import ServedRequest, served_request
from skyway_gateway.places.station_map import StationMap
from skyway_gateway.short_wait import ShortWait

#: The most different places of a request that are located; stations that are named do not count.
MOST_LOCATED: Final = 20

#: If swapped coordinates lie this near to a station, the answer says that they look swapped.
_SWAPPED_WITHIN_M: Final = 50_000.0


@dataclass(frozen=True, slots=True)
class PlaceServer:
    """Finds the stations that serve places; `who` is the tenant that asks."""

    locator: Locator
    stations: StationMap
    composition: Composition
    wait: ShortWait

    async def serve(self, requested: CustomerRequest, *, who: str) -> ServedRequest:
        """The request with the stations that serve its places.

        Raises
        ------
        InvalidInput
            A place is not found, means several places, or has no open station within its walk.
        Conflict
            NO_NETWORK: no stations are known.
        BudgetSpent
            The tenant has asked for too many addresses.
        ServiceUnavailable
            The geocoder does not answer now.
        """
        fields: dict[CustomerPlace, str] = {}
        for field, place in requested.places():
            if place.station_id is None:
                fields.setdefault(place, f"{field}.{place.way}")
        if not fields:
            return served_request(requested, {})
        if len(fields) > MOST_LOCATED:
            detail = f"{len(fields)} different places exceed the limit of {MOST_LOCATED}"
            raise InvalidInput("packages", f"{detail}; stations that are named do not count")
        found = await self._candidates(fields, who=who)
        known = self.stations.by_id
        return served_request(requested, chosen_walks(requested, found, fields=fields, known=known))

    async def candidates(self, place: CustomerPlace, *, who: str) -> Sequence[Candidate]:
        """What a place may mean, each with its stations; errors are those of `serve`."""
        return (await self._candidates({place: place.way}, who=who))[place]

    async def _candidates(
        self, fields: Mapping[CustomerPlace, str], *, who: str
    ) -> Mapping[CustomerPlace, Sequence[Candidate]]:
        if not self.stations.stations:
            raise Conflict(
                "NO_NETWORK",
                "no station is known that could serve a place: no network is published, or it has "
                "more than 20,000 stations, which have to be named by station_id",
            )
        find = self.locator.find
        located = (find(place, field=field, who=who) for place, field in fields.items())
        found = dict(zip(fields, await asyncio.gather(*located), strict=True))
        near = {place: self._near(place, fields[place], found[place]) for place in fields}
        closed = await self._closed(near)
        return {place: _open(place, fields[place], near[place], closed) for place in fields}

    def _near(
        self, place: CustomerPlace, field: str, found: Sequence[FoundPlace]
    ) -> Sequence[Candidate]:
        near = [
            Candidate(each, walks)
            for each in found
            if (walks := self.stations.near(each.position, within_m=place.walk_limit_m))
        ]
        if not near:
            raise InvalidInput(field, self._out_of_reach(place, found[0].position))
        return near

    def _out_of_reach(self, place: CustomerPlace, position: Position) -> str:
        nearest = self.stations.nearest(position)
        said = f"no station lies within max_walk_m, {place.walk_limit_m:g} m"
        if nearest is None:
            return said
        exchanged = swapped(place.location)
        other = None if exchanged is None else self.stations.nearest(exchanged)
        if other is not None and other.walk_m <= _SWAPPED_WITHIN_M < nearest.walk_m:
            return f"{said}: latitude and longitude look swapped"
        name, away_km = nearest.station.station_id, nearest.walk_m / 1000
        return f"{said}; the nearest, {name!r}, is {away_km:.1f} km away"

    async def _closed(
        self, near: Mapping[CustomerPlace, Sequence[Candidate]]
    ) -> Collection[StationId]:
        """Which of the stations are closed, or are there no more; none if composition is away."""
        walks = (walk for found in near.values() for each in found for walk in each.walks)
        asked = tuple(dict.fromkeys(walk.station.station_id for walk in walks))
        query = StationCheckQuery(station_ids=asked)
        answer = await self.wait.answer_of(self.composition.check_stations(query))
        return () if answer is None else {*answer.closed, *answer.unknown}


def _open(
    place: CustomerPlace, field: str, near: Sequence[Candidate], closed: Collection[StationId]
) -> Sequence[Candidate]:
    """The candidates with their open stations."""
    kept = [
        Candidate(each.place, walks)
        for each in near
        if (walks := [walk for walk in each.walks if walk.station.station_id not in closed])
    ]
    if not kept:
        names = ", ".join(repr(walk.station.station_id) for walk in near[0].walks)
        raise InvalidInput(
            field, f"the stations within {place.walk_limit_m:g} m are closed or gone: {names}"
        )
    return kept
