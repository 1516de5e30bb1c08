"""What clients publish and subscribe to, within the access rules and the limits."""

import logging
from collections.abc import Mapping

from amqtt.errors import MQTTError
from amqtt.mqtt.publish import PublishPacket

from skyway.contracts.broker_rules import BrokerRules
from skyway_broker.client import Client
from skyway_broker.limits import Limits
from skyway_broker.retained import Retained
from skyway_broker.subscriptions import Subscriptions, is_filter, overlaps

log = logging.getLogger(__name__)


class Messages:
    """Distributes messages to the subscribed clients; `clients` has the client of each place."""

    def __init__(
        self, clients: Mapping[str, Client], *, rules: BrokerRules, limits: Limits
    ) -> None:
        self._clients = clients
        self._rules = rules
        self._limits = limits
        self._clients_by_filter = Subscriptions()
        self._last_messages = Retained()

    def drop(self, client: Client) -> None:
        """Remove all filters of a client."""
        self._clients_by_filter.drop(client.place)

    def send_last_will(self, client: Client) -> None:
        """Send a client's last will, as far as its account may publish it."""
        session = client.session
        topic = session.will_topic
        if not self._may_publish(client, topic):
            log.warning("last will not allowed", extra={"client": client.place})
            return
        qos, data = min(session.will_qos or 0, 1), bytes(session.will_message or b"")
        try:
            self._distribute(client, topic, data, qos, retained=bool(session.will_retain))
        except MQTTError as error:
            reason = str(error)
            log.warning("last will refused", extra={"client": client.place, "reason": reason})

    def publish(self, client: Client, packet: PublishPacket) -> None:
        """Distribute a client's message, or raise `MQTTError` when the topic is forbidden."""
        topic = packet.topic_name
        if not topic or not self._may_publish(client, topic):
            raise MQTTError(f"not allowed to publish on {topic[:100]}")
        data = bytes(packet.data)
        self._distribute(client, topic, data, packet.qos, retained=packet.retain_flag)

    def _may_publish(self, client: Client, topic: str) -> bool:
        # The length comes first: decisions of the rules are cached.
        return self._limits.allow_topic(topic) and self._rules.may_write(client.user_name, topic)

    def subscribe(self, client: Client, filters: list[tuple[str, int]]) -> list[int | None]:
        """Subscribe to all valid filters within what the client may read."""
        return [self._subscribe(client, *each) for each in filters]

    def _subscribe(self, client: Client, topic_filter: str, mqtt_qos: int) -> int | None:
        known = self._clients_by_filter
        is_one_more = not known.has(client.place, topic_filter)
        if (
            not is_filter(topic_filter)
            or not self._limits.allow_topic(topic_filter)
            or (is_one_more and known.count(client.place) >= client.limits.filters)
        ):
            return None
        granted = min(mqtt_qos, 1)
        readable = self._rules.readable(client.user_name)
        known.add(client.place, topic_filter, granted, readable=readable)
        return granted

    def send_retained(self, client: Client, topic_filter: str, mqtt_qos: int) -> int:
        """Send the retained messages of a filter that this client may read, and count them."""
        sent = 0
        for part in overlaps(topic_filter, self._rules.readable(client.user_name)):
            for topic, data, kept_qos in self._last_messages.under(part):
                if self._rules.may_read(client.user_name, topic):
                    client.deliver(topic, data, min(kept_qos, mqtt_qos), retained=True)
                    sent += 1
        return sent

    def unsubscribe(self, client: Client, filters: list[str]) -> None:
        """Remove these filters."""
        for topic_filter in filters:
            self._clients_by_filter.remove(client.place, topic_filter)

    def _distribute(
        self, sender: Client, topic: str, data: bytes, mqtt_qos: int, *, retained: bool
    ) -> None:
        if retained:
            self._last_messages.keep(
                topic, data, mqtt_qos, writer=sender.user_name, limits=sender.limits
            )
        for place, granted in self._clients_by_filter.matching(topic).items():
            client = self._clients.get(place)
            if client is not None and self._rules.may_read(client.user_name, topic):
                client.deliver(topic, data, min(mqtt_qos, granted), retained=False)
