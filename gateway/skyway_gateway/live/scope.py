"""Who looks at the picture, and at which part of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self, get_args

from skyway.errors import InvalidInput
from skyway.ids import DeliveryId
from skyway.runtime.http.identity import Caller
from skyway_gateway.live.picture import (
    ALL_PROVIDERS,
    Bounds,
    Change,
    Group,
    Item,
    Key,
    Kind,
    Picture,
    Tick,
)

_NUMBERS_OF_BOUNDS = 4
_MOST_LONGITUDE_DEG, _MOST_LATITUDE_DEG = 180.0, 90.0


@dataclass(frozen=True, slots=True)
class Scope:
    """A role with its subject, the kinds of items, and an area; viewers of one scope share a view.

    When the area crosses the date line, its west has the larger longitude.
    """

    role: str
    subject_id: str
    kinds: frozenset[Kind]
    bounds: Bounds | None = None

    @classmethod
    def of(cls, caller: Caller, *, kinds: str | None, bbox: str | None) -> Self:
        """What this caller asks for; operators share one scope.

        Raises
        ------
        InvalidInput
            An unknown kind, or a `bbox` that is not west,south,east,north in degrees.
        """
        subject_id = "" if caller.role == "operator" else caller.subject_id
        return cls(caller.role, subject_id, _kinds(kinds), None if bbox is None else _bounds(bbox))

    @classmethod
    def of_link(cls, delivery_id: DeliveryId) -> Self:
        """What the tracking page of a delivery sees."""
        return cls("link", delivery_id, frozenset(get_args(Kind)))

    def changes_in(self, tick: Tick) -> Sequence[Change]:
        """The changes that may concern this scope; others need not be looked at."""
        return tick.changes if self.role == "operator" else tick.of_groups(self._groups)

    def sees(self, key: Key, item: Item) -> bool:
        """Whether the item is in this scope."""
        return key.kind in self.kinds and self._may_see(item) and self._is_near(item.bounds)

    def part_of(self, picture: Picture) -> dict[Key, Item]:
        """The items of the picture that are in this scope."""
        is_operators = self.role == "operator"
        items = picture.every_item() if is_operators else picture.of_groups(self._groups)
        return {key: item for key, item in items if self.sees(key, item)}

    @property
    def _groups(self) -> tuple[Group, ...]:
        own = self.role, self.subject_id
        return (own, ALL_PROVIDERS) if self.role == "provider" else (own,)

    def _may_see(self, item: Item) -> bool:
        readers = item.readers
        match self.role:
            case "operator":
                return readers.operators
            case "provider":
                return readers.all_providers or readers.provider_id == self.subject_id
            case "customer":
                return readers.customer_id == self.subject_id
            case "link":
                return readers.linked_delivery_id == self.subject_id
            case _:
                return False

    def _is_near(self, bounds: Bounds | None) -> bool:
        if self.bounds is None or bounds is None:
            return True
        west, south, east, north = self.bounds
        item_west, item_south, item_east, item_north = bounds
        if item_south > north or item_north < south:
            return False
        if west <= east:
            return item_west <= east and item_east >= west
        return item_east >= west or item_west <= east


def _kinds(text: str | None) -> frozenset[Kind]:
    known: tuple[Kind, ...] = get_args(Kind)
    if text is None:
        return frozenset(known)
    asked = text.split(",")
    for each in asked:
        if each not in known:
            raise InvalidInput("kinds", f"{each[:40]!r} is not one of {', '.join(known)}")
    return frozenset(kind for kind in known if kind in asked)


def _bounds(text: str) -> Bounds:
    try:
        numbers = [float(each) for each in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != _NUMBERS_OF_BOUNDS:
        raise InvalidInput("bbox", "must be west,south,east,north in degrees")
    west, south, east, north = numbers
    in_range = all(abs(each) <= _MOST_LONGITUDE_DEG for each in (west, east)) and all(
        abs(each) <= _MOST_LATITUDE_DEG for each in (south, north)
    )
    if not in_range or south > north:
        raise InvalidInput(
            "bbox", "longitudes lie within 180 degrees, latitudes within 90, south below north"
        )
    return west, south, east, north
