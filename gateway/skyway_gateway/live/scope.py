"""Who looks at the picture, and at which part of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self, get_args

from skyway.errors import InvalidInput
from skyway.geo import Box
from skyway.ids import DeliveryId
from skyway.runtime.http.identity import Caller
from skyway_gateway.live.picture import (
    ALL_PROVIDERS,
    Change,
    Group,
    Item,
    Key,
    Kind,
    Picture,
    Tick,
)


@dataclass(frozen=True, slots=True)
class Scope:
    """A role with its subject, kinds of items, and an area; viewers of one scope share a view."""

    role: str
    subject_id: str
    kinds: frozenset[Kind]
    bounds: Box | None = None

    @classmethod
    def of(cls, caller: Caller, *, kinds: str | None, bbox: str | None) -> Self:
        """What this caller asks for; operators share one scope.

        Raises
        ------
        InvalidInput
            An unknown kind, or a `bbox` that is not west,south,east,north in degrees.
        """
        subject_id = "" if caller.role == "operator" else caller.subject_id
        try:
            bounds = None if bbox is None else Box.parse(bbox)
        except ValueError as error:
            raise InvalidInput("bbox", str(error)) from error
        return cls(caller.role, subject_id, _kinds(kinds), bounds)

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

    def _is_near(self, bounds: Box | None) -> bool:
        return self.bounds is None or bounds is None or self.bounds.meets(bounds)


def _kinds(text: str | None) -> frozenset[Kind]:
    known: tuple[Kind, ...] = get_args(Kind)
    if text is None:
        return frozenset(known)
    asked = text.split(",")
    for each in asked:
        if each not in known:
            raise InvalidInput("kinds", f"{each[:40]!r} is not one of {', '.join(known)}")
    return frozenset(kind for kind in known if kind in asked)
