"""Filters and topics: the subscriptions of clients, and the retained messages."""

from collections import defaultdict
from collections.abc import Iterator


class Subscriptions:
    """The clients of each filter.

    Exact filters are found by one look-up, filters with wildcards level by level. A client with
    overlapping filters is found once, with its highest `mqtt_qos`.
    """

    def __init__(self) -> None:
        self._exact: dict[str, dict[str, int]] = defaultdict(dict)
        self._wildcard: dict[str, dict[str, int]] = defaultdict(dict)
        self._levels: dict[str, list[str]] = {}
        self._filters_of: dict[str, set[str]] = defaultdict(set)

    def add(self, client: str, topic_filter: str, mqtt_qos: int) -> None:
        """Subscribe a client; the same filter again replaces its `mqtt_qos`."""
        kept = self._wildcard if _has_wildcard(topic_filter) else self._exact
        kept[topic_filter][client] = mqtt_qos
        self._filters_of[client].add(topic_filter)
        if kept is self._wildcard:
            self._levels[topic_filter] = topic_filter.split("/")

    def remove(self, client: str, topic_filter: str) -> None:
        """Remove a filter of a client; nothing happens when the client does not have it."""
        for kept in (self._exact, self._wildcard):
            clients = kept.get(topic_filter)
            if clients is not None:
                clients.pop(client, None)
                if not clients:
                    del kept[topic_filter]
                    self._levels.pop(topic_filter, None)
        self._filters_of[client].discard(topic_filter)

    def drop(self, client: str) -> None:
        """Remove all filters of a client."""
        for topic_filter in tuple(self._filters_of.get(client, ())):
            self.remove(client, topic_filter)
        self._filters_of.pop(client, None)

    def matching(self, topic: str) -> dict[str, int]:
        """The clients that subscribed to this topic, each with its `mqtt_qos`."""
        found = dict(self._exact.get(topic, ()))
        levels = topic.split("/")
        for topic_filter, clients in self._wildcard.items():
            if matches(self._levels[topic_filter], levels):
                for client, mqtt_qos in clients.items():
                    found[client] = max(mqtt_qos, found.get(client, 0))
        return found


def is_filter(topic_filter: str) -> bool:
    """Whether a text is a valid filter: `+` is a whole level, `#` the last level [MQTT-4.7.1]."""
    levels = topic_filter.split("/")
    return (
        topic_filter != ""
        and all(level in ("+", "#") or not _has_wildcard(level) for level in levels)
        and "#" not in levels[:-1]
    )


def matches(topic_filter: list[str], levels: list[str]) -> bool:
    """Whether a filter matches a topic, both split into levels."""
    if topic_filter[-1] == "#":
        topic_filter = topic_filter[:-1]
        if len(levels) < len(topic_filter):
            return False
    elif len(topic_filter) != len(levels):
        return False
    return all(part in ("+", level) for part, level in zip(topic_filter, levels, strict=False))


def _has_wildcard(topic_filter: str) -> bool:
    return "+" in topic_filter or "#" in topic_filter


class Retained:
    """The last retained message of each topic: payload and `mqtt_qos`."""

    def __init__(self) -> None:
        self._messages: dict[str, tuple[bytes, int]] = {}

    def keep(self, topic: str, data: bytes, mqtt_qos: int) -> None:
        """Replace the retained message of a topic; an empty payload clears it [MQTT-3.3.1-10]."""
        if data:
            self._messages[topic] = (data, mqtt_qos)
        else:
            self._messages.pop(topic, None)

    def under(self, topic_filter: str) -> Iterator[tuple[str, bytes, int]]:
        """Topic, payload and `mqtt_qos` of each retained message that a filter matches."""
        if topic_filter in self._messages:
            yield (topic_filter, *self._messages[topic_filter])
        elif "+" in topic_filter or "#" in topic_filter:
            levels = topic_filter.split("/")
            for topic, (data, mqtt_qos) in tuple(self._messages.items()):
                if matches(levels, topic.split("/")):
                    yield topic, data, mqtt_qos
