"""The last retained message of each topic."""

from collections.abc import Iterator

from skyway_broker.subscriptions import matches


class Retained:
    """Retained messages by topic: payload and `mqtt_qos`."""

    def __init__(self) -> None:
        self._messages: dict[str, tuple[bytes, int]] = {}

    def keep(self, topic: str, data: bytes, mqtt_qos: int) -> None:
        """Replace what is retained on a topic; an empty payload clears it [MQTT-3.3.1-10]."""
        if data:
            self._messages[topic] = (data, mqtt_qos)
        else:
            self._messages.pop(topic, None)

    def under(self, wanted: str) -> Iterator[tuple[str, bytes, int]]:
        """Topic, payload and `mqtt_qos` of all that a filter matches."""
        if wanted in self._messages:
            yield (wanted, *self._messages[wanted])
        elif "+" in wanted or "#" in wanted:
            levels = wanted.split("/")
            for topic, (data, mqtt_qos) in tuple(self._messages.items()):
                if matches(levels, topic.split("/")):
                    yield topic, data, mqtt_qos
