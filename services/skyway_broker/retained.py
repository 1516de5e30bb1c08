"""The last retained message of each topic, within the limits of its writer."""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

from amqtt.errors import MQTTError

from skyway_broker.limits import AccountLimits
from skyway_broker.topic_tree import TopicTree


@dataclass(frozen=True, slots=True)
class _Kept:
    data: bytes
    mqtt_qos: int
    writer: str


@dataclass(slots=True)
class _Use:
    """How many messages of an account are retained, and their bytes together."""

    messages: int = 0
    bytes: int = 0


class Retained:
    """The last retained message of each topic: payload and `mqtt_qos`."""

    def __init__(self) -> None:
        self._messages: TopicTree[_Kept] = TopicTree()
        self._used: dict[str, _Use] = defaultdict(_Use)

    def keep(
        self, topic: str, data: bytes, mqtt_qos: int, *, writer: str, limits: AccountLimits
    ) -> None:
        """Replace the retained message of a topic; an empty payload clears it [MQTT-3.3.1-10].

        Raises
        ------
        MQTTError
            The writer would have too many retained messages, or too many bytes of them. The topic
            has no retained message then.
        """
        kept = self._messages.get(topic)
        if kept is not None:
            self._forget(topic, kept)
        if not data:
            return
        use = self._used[writer]
        if use.messages >= limits.retained or use.bytes + len(data) > limits.retained_bytes:
            raise MQTTError(f"{writer} has too many retained messages, or too large ones")
        use.messages += 1
        use.bytes += len(data)
        self._messages.put(topic, _Kept(data, mqtt_qos, writer))

    def under(self, topic_filter: str) -> Iterator[tuple[str, bytes, int]]:
        """Topic, payload and `mqtt_qos` of each retained message that a filter matches.

        The filter has no `#`.
        """
        for topic, kept in self._messages.under(topic_filter):
            yield topic, kept.data, kept.mqtt_qos

    def _forget(self, topic: str, kept: _Kept) -> None:
        self._messages.pop(topic)
        use = self._used[kept.writer]
        use.messages -= 1
        use.bytes -= len(kept.data)
        if not use.messages:
            del self._used[kept.writer]
