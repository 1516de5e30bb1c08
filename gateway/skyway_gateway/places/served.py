"""What serves the places of a request, for customers, and the variants that a quote compares."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Final

from pydantic import Field

from skyway.delivery.request import DeliveryRequest, Place
from skyway.ids import StationId
from skyway.json_model import JsonModel
from skyway_gateway.places.customer_request import CustomerPlace, CustomerRequest
from skyway_gateway.places.station_map import NearStation, Walk

#: The variants of a request that a quote compares; each is planned, and charged, as a quote.
MOST_VARIANTS: Final = 3


class ServedPlace(JsonModel):
    """A place that a customer named, the station that serves it, and other stations near it."""

    fields: Annotated[
        tuple[str, ...], Field(description="The fields of the request that name the place.")
    ]
    requested: Annotated[CustomerPlace, Field(description="The place as it was requested.")]
    served_by: Annotated[NearStation, Field(description="The station that serves the place.")]
    alternatives: Annotated[
        tuple[NearStation, ...],
        Field(description="Up to 3 other stations that could serve it, the nearest first."),
    ] = ()

    def served_in(self, request: DeliveryRequest) -> "ServedPlace":
        """The same place as it is served in a variant of the request."""
        # Alternatives are the same in all variants.
        field = min(self.fields, key=lambda each: each.endswith("alternative"))
        station_id = _station_at(request, field)
        stations = (self.served_by, *self.alternatives)
        served_by = next(each for each in stations if each.station_id == station_id)
        others = tuple(each for each in stations if each is not served_by)
        return self.model_copy(update={"served_by": served_by, "alternatives": others})


@dataclass(frozen=True, slots=True)
class ServedRequest:
    """A request with its stations: variants, of which the first has the nearest station of each."""

    variants: tuple[DeliveryRequest, ...]
    places: tuple[ServedPlace, ...]

    @property
    def nearest(self) -> DeliveryRequest:
        """The request that the nearest stations serve."""
        return self.variants[0]


def served_request(
    requested: CustomerRequest, walks_of: Mapping[CustomerPlace, Sequence[Walk]]
) -> ServedRequest:
    """The request with the stations of its places, of which each has at least one.

    A further variant differs from the first in one place, where another station serves. Those with
    the shortest additional walk are kept. No further variant has its pickup as a destination.
    Alternatives are always served by the nearest station.
    """
    nearest = {place: walks[0].station.station_id for place, walks in walks_of.items()}
    variants = [_at(requested, nearest, nearest)]
    others = sorted(
        (walk.walk_m - walks[0].walk_m, walk.station.station_id, number)
        for number, walks in enumerate(walks_of.values())
        for walk in walks[1:]
    )
    places = tuple(walks_of)
    for _, station_id, number in others:
        variant = _at(requested, {**nearest, places[number]: station_id}, nearest)
        # A place that is used only as an alternative makes no new variant.
        if variant not in variants and variant.pickup.station_id not in variant.destinations:
            variants.append(variant)
        if len(variants) == MOST_VARIANTS:
            break
    return ServedRequest(tuple(variants), tuple(_served(requested, walks_of)))


Chosen = Mapping[CustomerPlace, StationId]


def _at(requested: CustomerRequest, chosen: Chosen, nearest: Chosen) -> DeliveryRequest:
    return requested.at_stations(
        lambda place: place.station_id or chosen[place],
        alternative_by=lambda place: place.station_id or nearest[place],
    )


def _station_at(request: DeliveryRequest, field: str) -> StationId:
    """The station of a field, as `CustomerRequest.places` names it."""
    if field == "pickup":
        return request.pickup.station_id
    _, number, end = field.split(".")
    place: Place = getattr(request.packages[int(number)], end)
    return place.station_id


def _served(
    requested: CustomerRequest, walks_of: Mapping[CustomerPlace, Sequence[Walk]]
) -> Iterator[ServedPlace]:
    for place, walks in walks_of.items():
        first, *others = map(NearStation.of, walks)
        fields = tuple(field for field, each in requested.places() if each == place)
        yield ServedPlace(
            fields=fields, requested=place, served_by=first, alternatives=tuple(others)
        )
