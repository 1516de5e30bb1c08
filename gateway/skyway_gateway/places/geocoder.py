"""Finds addresses: the port of a geocoder, and the embedded one, which knows names and no streets.

The embedded geocoder knows the stations of the known networks by id and by name, and the bundled
places by names that no station has. It compares whole names, so it never guesses.
"""

import unicodedata
from typing import NamedTuple, Protocol

from skyway.geo import Position
from skyway.network.gazetteer import bundled_places
from skyway_gateway.places.station_map import StationMap


class FoundPlace(NamedTuple):
    """A place that an address may mean; the label is for people."""

    label: str
    position: Position


class Geocoder(Protocol):
    """Finds addresses."""

    #: Why an address is not found, and what to do; a sentence for customers.
    limits: str
    #: What one address costs of the tenant's budget of requests.
    cost: float

    async def find(self, address: str) -> tuple[FoundPlace, ...]:
        """The places that the address may mean, the likeliest first.

        Raises
        ------
        ServiceUnavailable
            The geocoder does not answer now.
        """
        ...

    async def close(self) -> None:
        """Close what is open."""
        ...


class NameGeocoder:
    """The embedded geocoder."""

    limits = (
        "the embedded geocoder knows names of stations and towns, such as 'San Marcos', and no "
        "streets; give a location or a plus code, or have the operator set SKYWAY_GEOCODER_URL"
    )
    cost = 0.0

    def __init__(self, stations: StationMap) -> None:
        self._map = stations
        self._revision = -1
        self._named: dict[str, list[FoundPlace]] = {}

    async def find(self, address: str) -> tuple[FoundPlace, ...]:
        """The stations and towns that have this name."""
        if self._revision != self._map.revision:
            self._revision, self._named = self._map.revision, self._all_named()
        return tuple(self._named.get(_key(address), ()))

    async def close(self) -> None:
        """Nothing is open."""

    def _all_named(self) -> dict[str, list[FoundPlace]]:
        named: dict[str, list[FoundPlace]] = {}
        for station in self._map.stations:
            label = station.name or station.station_id
            found = FoundPlace(label, station.position)
            for key in {_key(station.station_id), _key(label)}:
                named.setdefault(key, []).append(found)
        for name, position in bundled_places():
            named.setdefault(_key(name), [FoundPlace(name, position)])
        return named


def _key(name: str) -> str:
    """A name without accents, case and punctuation."""
    letters = unicodedata.normalize("NFKD", name.casefold())
    kept = (each if each.isalnum() else " " for each in letters if not unicodedata.combining(each))
    return " ".join("".join(kept).split())
