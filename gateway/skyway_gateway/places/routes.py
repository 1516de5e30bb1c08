"""GET /v1/places: the stations that would serve a place, for forms that show them before."""

from collections.abc import Sequence
from typing import Annotated

from fastapi import Query
from pydantic import Field, ValidationError

from skyway.errors import InvalidInput
from skyway.geo import Position
from skyway.json_model import JsonModel, QueryModel
from skyway.runtime.http.answers import conflicts
from skyway.runtime.http.service_router import ServiceRouter
from skyway_gateway.access.routes import KeyCaller
from skyway_gateway.livemode import ByMode
from skyway_gateway.places.choose import Candidate
from skyway_gateway.places.customer_request import (
    Address,
    CustomerPlace,
    Latitude,
    Longitude,
    PlusCode,
    WalkLimit,
)
from skyway_gateway.places.serve import PlaceServer
from skyway_gateway.places.station_map import MOST_NEAR, NearStation


class PlaceQuery(QueryModel):
    """A place: an address, a plus code, or latitude and longitude."""

    address: Address | None = None
    plus_code: PlusCode | None = None
    latitude: Latitude | None = None
    longitude: Longitude | None = None
    max_walk_m: WalkLimit | None = None

    def place(self) -> CustomerPlace:
        """The place in the form of a request; it is checked after the caller is.

        Raises
        ------
        InvalidInput
            The query names no place, half of one, or several.
        """
        given = dict(self)
        ends = {name: given.pop(name) for name in ("latitude", "longitude")}
        if None in ends.values() and any(end is not None for end in ends.values()):
            raise InvalidInput("query", "latitude and longitude are given together")
        location = None if None in ends.values() else ends
        try:
            return CustomerPlace.model_validate({**given, "location": location})
        except ValidationError as error:
            words = error.errors()[0]["msg"].removeprefix("Value error, ")
            raise InvalidInput("query", words) from error


class PlaceCandidate(JsonModel):
    """A place that the query may mean, and the stations that could serve it."""

    label: Annotated[str, Field(description="What the place is called, for people.")]
    position: Annotated[Position, Field(description="[longitude, latitude] in degrees.")]
    stations: Annotated[
        tuple[NearStation, ...],
        Field(description="Up to 4 open stations, the nearest first: the first would serve it."),
    ]


class PlaceCandidates(JsonModel):
    """The places that a query may mean, the likeliest first."""

    candidates: Annotated[
        tuple[PlaceCandidate, ...],
        Field(description="Places with a station near; a request that means several is refused."),
    ]


def place_routes(*, places: ByMode[PlaceServer]) -> ServiceRouter:
    """GET /v1/places."""
    router = ServiceRouter(tags=("deliveries",))

    @router.get("/v1/places", responses=conflicts("NO_NETWORK"))
    async def find_places(
        caller: KeyCaller, query: Annotated[PlaceQuery, Query()]
    ) -> PlaceCandidates:
        """Find the stations that could serve an address, a plus code, or a location.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        served = places.of(caller.subject_id)
        return _shown(await served.candidates(query.place(), who=str(caller)))

    return router


def _shown(found: Sequence[Candidate]) -> PlaceCandidates:
    return PlaceCandidates(
        candidates=tuple(
            PlaceCandidate(
                label=each.place.label,
                position=each.place.position,
                stations=tuple(NearStation.of(walk) for walk in each.walks[:MOST_NEAR]),
            )
            for each in found
        )
    )
