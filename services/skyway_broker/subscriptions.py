"""Who has subscribed to what: exact filters by one look-up, wildcards level by level."""

from collections import defaultdict


class Subscriptions:
    """Filters by client; a client with overlapping filters is found once, at its highest QoS."""

    def __init__(self) -> None:
        self._exact: dict[str, dict[str, int]] = defaultdict(dict)
        self._wildcard: dict[str, dict[str, int]] = defaultdict(dict)
        self._levels: dict[str, list[str]] = {}
        self._filters_of: dict[str, set[str]] = defaultdict(set)

    def add(self, client: str, wanted: str, mqtt_qos: int) -> None:
        """Subscribe a client; the same filter again replaces its QoS."""
        kept = self._wildcard if _has_wildcard(wanted) else self._exact
        kept[wanted][client] = mqtt_qos
        self._filters_of[client].add(wanted)
        if kept is self._wildcard:
            self._levels[wanted] = wanted.split("/")

    def remove(self, client: str, wanted: str) -> None:
        """Take one filter of a client away; nothing happens if it has none such."""
        for kept in (self._exact, self._wildcard):
            clients = kept.get(wanted)
            if clients is not None:
                clients.pop(client, None)
                if not clients:
                    del kept[wanted]
                    self._levels.pop(wanted, None)
        self._filters_of[client].discard(wanted)

    def drop(self, client: str) -> None:
        """Take all filters of a client away."""
        for wanted in tuple(self._filters_of.get(client, ())):
            self.remove(client, wanted)
        self._filters_of.pop(client, None)

    def matching(self, topic: str) -> dict[str, int]:
        """The clients that want a message on this topic, each with its `mqtt_qos`."""
        found = dict(self._exact.get(topic, ()))
        levels = topic.split("/")
        for wanted, clients in self._wildcard.items():
            if matches(self._levels[wanted], levels):
                for client, mqtt_qos in clients.items():
                    found[client] = max(mqtt_qos, found.get(client, 0))
        return found


def is_filter(wanted: str) -> bool:
    """Whether a text is a filter: `+` fills a level, `#` fills the last one [MQTT-4.7.1]."""
    levels = wanted.split("/")
    return (
        wanted != ""
        and all(level in ("+", "#") or not _has_wildcard(level) for level in levels)
        and "#" not in levels[:-1]
    )


def matches(wanted: list[str], levels: list[str]) -> bool:
    """Whether a filter matches a topic, both split into levels."""
    if wanted[-1] == "#":
        wanted = wanted[:-1]
        if len(levels) < len(wanted):
            return False
    elif len(wanted) != len(levels):
        return False
    return all(part in ("+", level) for part, level in zip(wanted, levels, strict=False))


def _has_wildcard(wanted: str) -> bool:
    return "+" in wanted or "#" in wanted
