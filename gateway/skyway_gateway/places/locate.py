"""Locates a place that a customer names: a point, a plus code, or an address."""

from dataclasses import dataclass
from typing import Final

from openlocationcode import openlocationcode

from skyway.errors import InvalidInput
from skyway.geo import Position
from skyway.runtime.limits import FairQueue, Meter
from skyway_gateway.places.customer_request import CustomerPlace, Location
from skyway_gateway.places.geocoder import FoundPlace, Geocoder

#: The fewest digits of a plus code: its area is then 280 m wide at most.
_FEWEST_DIGITS: Final = 8

#: The longest plus code, and its shortest form before the reference place.
_LONGEST_CODE: Final = 16


@dataclass(frozen=True, slots=True)
class Locator:
    """Locates places; the geocoder is asked in the tenant's turn, and the tenant pays for it."""

    geocoder: Geocoder
    turns: FairQueue
    requests: Meter

    async def find(self, place: CustomerPlace, *, field: str, who: str) -> tuple[FoundPlace, ...]:
        """Where the place may be, at least one possibility; an address may have several.

        Raises
        ------
        InvalidInput
            The plus code is invalid or too short; or the geocoder does not find the address.
        BudgetSpent
            TENANT_REQUESTS: the tenant has sent too much. GEOCODING: too many of its addresses
            wait.
        ServiceUnavailable
            The geocoder does not answer now.
        """
        if place.location is not None:
            where = f"{place.location.latitude:g}, {place.location.longitude:g}"
            return (FoundPlace(where, place.location.position),)
        if place.plus_code is not None:
            return await self._of_plus_code(place.plus_code, field, who)
        return await self._of_address(place.address or "", field, who)

    async def _of_plus_code(self, text: str, field: str, who: str) -> tuple[FoundPlace, ...]:
        code, *reference = text.split(maxsplit=1)
        code = code.upper().rstrip(",")
        if len(code) > _LONGEST_CODE or not openlocationcode.isValid(code):
            raise InvalidInput(field, "is not a plus code, such as 76X3VHMC+8R")
        if openlocationcode.isFull(code):
            return (_area_of(code, code, field),)
        if not openlocationcode.isShort(code):
            raise InvalidInput(field, "is no place on Earth")
        if not reference:
            raise InvalidInput(
                field, "is a short plus code: put a reference place after it, as V3M5+88 San Marcos"
            )
        return tuple(
            _area_of(
                openlocationcode.recoverNearest(
                    code, near.position.latitude_deg, near.position.longitude_deg
                ),
                f"{code} {near.label}",
                field,
            )
            for near in await self._of_address(reference[0], field, who)
        )

    async def _of_address(self, text: str, field: str, who: str) -> tuple[FoundPlace, ...]:
        self.requests.spend(who, self.geocoder.cost)
        async with self.turns.turn(who):
            found = await self.geocoder.find(text)
        if not found:
            raise InvalidInput(field, f"is not found: {self.geocoder.limits}")
        return tuple(dict.fromkeys(found))


def _area_of(code: str, label: str, field: str) -> FoundPlace:
    """The middle of the area of a full code."""
    area = openlocationcode.decode(code)
    if area.codeLength < _FEWEST_DIGITS:
        raise InvalidInput(
            field, f"has {area.codeLength} digits and means a whole region: give at least 8"
        )
    return FoundPlace(label, Position(area.longitudeCenter, area.latitudeCenter))


def swapped(location: Location | None) -> Position | None:
    """The point with latitude and longitude exchanged; None if there is none."""
    if location is None or abs(location.longitude) > 90:
        return None
    return Position(location.latitude, location.longitude)
