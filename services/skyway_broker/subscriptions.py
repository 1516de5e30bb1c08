"""The subscriptions of clients, each narrowed to what its account may read."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from skyway_broker.topic_tree import TopicTree


@dataclass(frozen=True, slots=True)
class _Subscription:
    """One filter of a client, and the parts of it that the client may read."""

    mqtt_qos: int
    parts: frozenset[str]


class Subscriptions:
    """The clients of each filter.

    A filter counts only where its client may read: `#` of a drone is found by the drone's own
    topics, so it costs nothing when others publish. A client with overlapping filters is found
    once, with its highest `mqtt_qos`.
    """

    def __init__(self) -> None:
        self._clients: TopicTree[dict[str, int]] = TopicTree()
        self._filters_of: dict[str, dict[str, _Subscription]] = defaultdict(dict)

    def add(
        self, client: str, topic_filter: str, mqtt_qos: int, *, readable: Iterable[str]
    ) -> None:
        """Subscribe a client within `readable`; the same filter again replaces its `mqtt_qos`."""
        parts = overlaps(topic_filter, readable)
        self._filters_of[client][topic_filter] = _Subscription(mqtt_qos, parts)
        for part in parts:
            self._note(client, part)

    def count(self, client: str) -> int:
        """How many filters a client has."""
        return len(self._filters_of.get(client, ()))

    def has(self, client: str, topic_filter: str) -> bool:
        """Whether a client has this filter."""
        return topic_filter in self._filters_of.get(client, ())

    def remove(self, client: str, topic_filter: str) -> None:
        """Remove a filter of a client; nothing happens when the client does not have it."""
        removed = self._filters_of.get(client, {}).pop(topic_filter, None)
        for part in () if removed is None else removed.parts:
            self._note(client, part)

    def drop(self, client: str) -> None:
        """Remove all filters of a client."""
        filters = self._filters_of.pop(client, {})
        for part in {part for each in filters.values() for part in each.parts}:
            self._note(client, part)

    def matching(self, topic: str) -> dict[str, int]:
        """The clients that subscribed to this topic, each with its `mqtt_qos`."""
        found: dict[str, int] = {}
        for clients in self._clients.matching(topic):
            for client, mqtt_qos in clients.items():
                found[client] = max(mqtt_qos, found.get(client, 0))
        return found

    def _note(self, client: str, part: str) -> None:
        """Keep what all filters of the client together say about one part."""
        granted = [
            each.mqtt_qos
            for each in self._filters_of.get(client, {}).values()
            if part in each.parts
        ]
        clients = self._clients.get(part) or {}
        if granted:
            clients[client] = max(granted)
        else:
            clients.pop(client, None)
        if clients:
            self._clients.put(part, clients)
        else:
            self._clients.pop(part)


def is_filter(topic_filter: str) -> bool:
    """Whether a text is a valid filter: `+` is a whole level, `#` the last level [MQTT-4.7.1]."""
    levels = topic_filter.split("/")
    return (
        topic_filter != ""
        and all(level in ("+", "#") or not _has_wildcard(level) for level in levels)
        and "#" not in levels[:-1]
    )


def overlaps(topic_filter: str, readable: Iterable[str]) -> frozenset[str]:
    """The parts of a filter that are within any of the `readable` filters."""
    parts = (_overlap(topic_filter, each) for each in readable)
    return frozenset(part for part in parts if part is not None)


def _overlap(topic_filter: str, readable: str) -> str | None:
    """The filter of all topics that both filters match; None when there is no such topic.

    `readable` has no `#`.
    """
    asked, allowed = topic_filter.split("/"), readable.split("/")
    if asked[-1] == "#":
        asked = asked[:-1]
        asked += allowed[len(asked) :]
    if len(asked) != len(allowed):
        return None
    levels = [
        theirs if ours == "+" else ours
        for ours, theirs in zip(asked, allowed, strict=True)
        if ours == theirs or "+" in (ours, theirs)
    ]
    return "/".join(levels) if len(levels) == len(allowed) else None


def _has_wildcard(topic_filter: str) -> bool:
    return "+" in topic_filter or "#" in topic_filter
