"""Chooses among what the places of a request may mean: one place each, and one connected area."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from skyway.announced_networks import KnownStation
from skyway.errors import InvalidInput
from skyway.ids import StationId
from skyway_gateway.places.customer_request import CustomerPlace, CustomerRequest
from skyway_gateway.places.geocoder import FoundPlace
from skyway_gateway.places.station_map import Area, Walk

#: The characters of each label that are shown for an ambiguous address.
_SHOWN: Final = 60


class Candidate(NamedTuple):
    """A place that a customer may mean, and the stations near it, the nearest first."""

    place: FoundPlace
    walks: Sequence[Walk]


#: The walks from each place to the stations near it.
Walks = Mapping[CustomerPlace, Sequence[Walk]]


def chosen_walks(
    requested: CustomerRequest,
    candidates: Mapping[CustomerPlace, Sequence[Candidate]],
    *,
    fields: Mapping[CustomerPlace, str],
    known: Mapping[StationId, KnownStation],
) -> Walks:
    """The walks to stations that ways connect with the pickup.

    The nearest station of the pickup decides the area, unless another area also serves all other
    places and has all stations that the request names.

    Parameters
    ----------
    fields
        The field that names each place.
    known
        All stations that the gateway knows.

    Raises
    ------
    InvalidInput
        A place means several places, or no area serves all of them.
    """
    walks = {place: _the_one(found, fields[place]) for place, found in candidates.items()}
    named = [place.station_id for _, place in requested.places() if place.station_id is not None]
    named_areas = {known[each].area for each in named if each in known}
    areas = list(_areas_of_pickup(requested.pickup, walks, known))
    inside = [_in_area(walks, area) for area in areas]
    for area, chosen in zip(areas, inside, strict=True):
        if all(chosen.values()) and named_areas <= {area}:
            return chosen
    if not areas:  # a pickup that is not known is refused by later checks
        return walks
    for place, chosen_of_place in inside[0].items():
        if not chosen_of_place:
            detail = f"no station within {place.walk_limit_m:g} m has a way from the pickup in the "
            raise InvalidInput(fields[place], f"{detail}network {areas[0][0]!r}")
    return inside[0]


def _the_one(candidates: Sequence[Candidate], field: str) -> Sequence[Walk]:
    """The walks of the first candidate, if the same station is the nearest of all candidates."""
    nearest = {each.walks[0].station.station_id for each in candidates}
    if len(nearest) > 1:
        labels = "; ".join(each.place.label[:_SHOWN] for each in candidates)
        raise InvalidInput(
            field, f"means several places, see GET /v1/places and give a location: {labels}"
        )
    return candidates[0].walks


def _areas_of_pickup(
    pickup: CustomerPlace, walks: Walks, known: Mapping[StationId, KnownStation]
) -> Iterator[Area]:
    """The areas that may serve the pickup, the nearest first."""
    if pickup.station_id is None:
        yield from dict.fromkeys(walk.station.area for walk in walks[pickup])
    elif pickup.station_id in known:
        yield known[pickup.station_id].area


def _in_area(walks: Walks, area: Area) -> Walks:
    return {
        place: [walk for walk in each if walk.station.area == area] for place, each in walks.items()
    }
