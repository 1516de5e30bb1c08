"""The picture: every item that somebody may see, and what has changed since the last look."""

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final, Literal, NamedTuple

from skyway.geo import Box

#: A JSON object without nulls: in a patch, null removes a member.
JsonObject = Mapping[str, Any]


def patch_between(before: JsonObject, after: JsonObject) -> dict[str, Any]:
    """The patch that turns `before` into `after`; empty when they are equal.

    Objects are compared member by member. Arrays are replaced as a whole, as RFC 7396 says.
    """
    patch: dict[str, Any] = dict.fromkeys(before.keys() - after.keys())
    for name, value in after.items():
        earlier = before.get(name)
        if value == earlier:
            continue
        if isinstance(value, dict) and isinstance(earlier, dict):
            patch[name] = patch_between(earlier, value)
        else:
            patch[name] = value
    return patch


Kind = Literal["drones", "missions", "stations", "closures", "alarms", "deliveries", "services"]

#: Who sees the same items: a role, and the subject in it.
Group = tuple[str, str]

#: What every provider sees.
ALL_PROVIDERS: Final[Group] = ("provider", "")


class Key(NamedTuple):
    """Which item it is.

    What a customer sees of a drone or mission is an item of its own, for the `audience` of that
    customer.
    """

    kind: Kind
    item_id: str
    audience: str = ""


@dataclass(frozen=True, slots=True)
class Readers:
    """Who sees an item: operators, all providers or one, one customer, one tracking page."""

    operators: bool = False
    all_providers: bool = False
    provider_id: str | None = None
    customer_id: str | None = None
    linked_delivery_id: str | None = None

    @property
    def groups(self) -> tuple[Group, ...]:
        """Those beside the operators, so that each finds what it may see without a search."""
        return tuple(
            group
            for group, is_reader in (
                (ALL_PROVIDERS, self.all_providers),
                (("provider", self.provider_id or ""), self.provider_id is not None),
                (("customer", self.customer_id or ""), self.customer_id is not None),
                (("link", self.linked_delivery_id or ""), self.linked_delivery_id is not None),
            )
            if is_reader
        )


#: Items that only operators see.
OPERATORS: Final = Readers(operators=True)
#: Items that operators and all providers see.
FLEETS: Final = Readers(operators=True, all_providers=True)


@dataclass(frozen=True, slots=True)
class Item:
    """A JSON object without nulls, who sees it, and where it is; without bounds, everywhere."""

    document: JsonObject
    readers: Readers
    bounds: Box | None = None


@dataclass(frozen=True)
class Change:
    """An item before and after; None where it was not or is no longer."""

    key: Key
    before: Item | None
    after: Item | None

    @property
    def items(self) -> tuple[Item, ...]:
        """The item before and after, without None."""
        return tuple(item for item in (self.before, self.after) if item is not None)

    @cached_property
    def whole(self) -> str:
        """The member of a patch that brings the item."""
        return self._member({} if self.after is None else self.after.document)

    @cached_property
    def patch(self) -> str:
        """The member of a patch for viewers who have the item as it was before."""
        if self.before is None or self.after is None:
            return self.whole
        return self._member(patch_between(self.before.document, self.after.document))

    @cached_property
    def removal(self) -> str:
        """The member of a patch that removes the item."""
        return self._member(None)

    def _member(self, value: JsonObject | None) -> str:
        return f"{json.dumps(self.key.item_id)}:{as_json(value)}"


@dataclass(frozen=True)
class Tick:
    """All changes of one look, encoded once for all viewers."""

    number: int
    changes: tuple[Change, ...]

    def of_groups(self, groups: Iterable[Group]) -> Sequence[Change]:
        """The changes that these groups may see, each once."""
        found = [change for group in groups for change in self._by_group.get(group, ())]
        return [*{change.key: change for change in found}.values()]

    @cached_property
    def _by_group(self) -> Mapping[Group, Sequence[Change]]:
        found: dict[Group, list[Change]] = defaultdict(list)
        for change in self.changes:
            for group in {group for item in change.items for group in item.readers.groups}:
                found[group].append(change)
        return found


@dataclass(slots=True)
class Picture:
    """All items by kind; `put` and `remove` change them, `tick` ends a look."""

    number: int = 0
    _items: dict[Kind, dict[Key, Item]] = field(default_factory=lambda: defaultdict(dict))
    _by_group: dict[Group, dict[Key, Item]] = field(default_factory=lambda: defaultdict(dict))
    _changed: dict[Key, Item | None] = field(default_factory=dict)

    def of_kind(self, kind: Kind) -> Mapping[Key, Item]:
        """All items of a kind."""
        return self._items[kind]

    def get(self, key: Key) -> Item | None:
        """The item with this key, if there is one."""
        return self._items[key.kind].get(key)

    def every_item(self) -> Iterator[tuple[Key, Item]]:
        """All items with their keys."""
        for items in self._items.values():
            yield from items.items()

    def of_groups(self, groups: Iterable[Group]) -> Iterator[tuple[Key, Item]]:
        """The items that these groups may see; what several may see comes several times."""
        for group in groups:
            yield from self._by_group.get(group, {}).items()

    def put(self, items: Iterable[tuple[Key, Item]]) -> None:
        """Add or replace these items."""
        for key, item in items:
            before = self.get(key)
            if before != item:
                self._changed.setdefault(key, before)
                self._items[key.kind][key] = item
                self._show(key, before, item)

    def remove(self, keys: Iterable[Key]) -> None:
        """Remove these items, if they are there."""
        for key in keys:
            before = self._items[key.kind].pop(key, None)
            if before is not None:
                self._changed.setdefault(key, before)
                self._show(key, before, None)

    def _show(self, key: Key, before: Item | None, after: Item | None) -> None:
        """Show the item to the groups that may see it now, and to no others."""
        groups = () if after is None else after.readers.groups
        for group in () if before is None else before.readers.groups:
            if group not in groups:
                del self._by_group[group][key]
                if not self._by_group[group]:
                    del self._by_group[group]
        for group in groups:
            if after is not None:
                self._by_group[group][key] = after

    def tick(self) -> Tick | None:
        """The changes since the last tick; None when nothing has changed."""
        changes = tuple(self._changes())
        self._changed.clear()
        if not changes:
            return None
        self.number += 1
        return Tick(self.number, changes)

    def _changes(self) -> Iterator[Change]:
        for key, before in self._changed.items():
            after = self.get(key)
            if before != after:
                yield Change(key, before, after)


def as_json(value: Any) -> str:  # any JSON value
    """Compact JSON; no character of it ends a line of an event stream."""
    return json.dumps(value, separators=(",", ":"))
