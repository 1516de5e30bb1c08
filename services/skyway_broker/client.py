"""The connection of one client: reads its packets in order, and writes without waiting."""

import asyncio
import logging
from typing import Final, Protocol

from amqtt.adapters import StreamReaderAdapter, StreamWriterAdapter
from amqtt.errors import MQTTError
from amqtt.mqtt import packet_class
from amqtt.mqtt.connack import CONNECTION_ACCEPTED, ConnackPacket
from amqtt.mqtt.disconnect import DisconnectPacket
from amqtt.mqtt.packet import PUBLISH, MQTTFixedHeader, MQTTPacket
from amqtt.mqtt.pingreq import PingReqPacket
from amqtt.mqtt.pingresp import PingRespPacket
from amqtt.mqtt.puback import PubackPacket
from amqtt.mqtt.publish import PublishPacket
from amqtt.mqtt.suback import SubackPacket
from amqtt.mqtt.subscribe import SubscribePacket
from amqtt.mqtt.unsuback import UnsubackPacket
from amqtt.mqtt.unsubscribe import UnsubscribePacket
from amqtt.session import Session

from skyway_broker.usage import Usage

#: Seconds for the last bytes of a connection that is closed.
_LAST_WORDS_S: Final = 10.0


class ClientReader(StreamReaderAdapter):  # type: ignore[misc] # amqtt has no types
    """amqtt's reader, which refuses an invented length instead of reading everything."""

    async def read(self, n: int = -1) -> bytes:
        """Exactly `n` bytes."""
        if n < 0:
            raise MQTTError("a length in a packet is wrong")
        data: bytes = await super().read(n)
        return data


class ClientWriter(StreamWriterAdapter):  # type: ignore[misc] # amqtt has no types
    """amqtt's writer, which also counts waiting bytes, and closes without waiting."""

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        super().__init__(writer)
        self._transport = writer.transport

    @property
    def waiting_bytes(self) -> int:
        """Written bytes that the client has not received yet."""
        return self._transport.get_write_buffer_size()

    async def close(self) -> None:
        """Close the connection once everything is written, or soon; this does not wait."""
        self.is_closed = True
        self._transport.close()
        if self.waiting_bytes:
            asyncio.get_running_loop().call_later(_LAST_WORDS_S, self._transport.abort)

    def abort(self) -> None:
        """Close the connection now."""
        self.is_closed = True
        self._transport.abort()


log = logging.getLogger(__name__)

#: The SUBACK code for an invalid filter.
NOT_A_FILTER = 0x80

#: A silence of this many keepalives ends a connection [MQTT-3.1.2-24].
_KEEP_ALIVES = 1.5

#: A packet counts as one, and as one more for each so many of its bytes.
_BYTES_PER_COUNT: Final = 4 << 10
#: A filter counts as one, and as one more for each so many retained messages that it finds.
_RETAINED_PER_COUNT: Final = 10


class Traffic(Protocol):
    """The calls of a connection to the broker."""

    def publish(self, client: "Client", packet: PublishPacket) -> None:
        """Distribute a message, or raise `MQTTError` to end the connection."""

    def subscribe(self, client: "Client", filters: list[tuple[str, int]]) -> list[int | None]:
        """Subscribe; the result is the `mqtt_qos` of each filter, None for an invalid filter."""

    def send_retained(self, client: "Client", topic_filter: str, mqtt_qos: int) -> int:
        """Send the retained messages of a filter that the client may read, and count them."""

    def unsubscribe(self, client: "Client", filters: list[str]) -> None:
        """Remove these filters."""


class Client:
    """The connection of one accepted client.

    amqtt starts a task for each packet and for each delivered message. Here packets are handled one
    after another and written immediately, so they stay in order.
    """

    def __init__(
        self,
        session: Session,
        *,
        place: str,
        reader: ClientReader,
        writer: ClientWriter,
        traffic: Traffic,
        usage: Usage,
        password_hash: str | None,
    ) -> None:
        self.session = session
        self.place = place
        self.user_name = session.username or ""
        self.limits = usage.limits_of(self.user_name)
        #: The hash of the password at the time of the connection.
        self.password_hash = password_hash
        self._usage = usage
        self._limits = usage.limits
        self._reader = reader
        self._writer = writer
        self._traffic = traffic

    async def serve(self) -> bool:
        """Handle packet after packet; True when the client leaves with a DISCONNECT.

        Raises
        ------
        TimeoutError
            No packet came for 1.5 times the keepalive, or half a packet, or an answer is unread.
        MQTTError
            The client broke the protocol or a limit, or published on a forbidden topic.
        """
        self._send(ConnackPacket.build(0, CONNECTION_ACCEPTED))
        longest_s = self._limits.silence_s
        silence_s = min(_KEEP_ALIVES * self.session.keep_alive or longest_s, longest_s)
        while True:
            packet = await self._next_packet(silence_s)
            if packet is None or isinstance(packet, DisconnectPacket):
                return packet is not None
            await self._handle(packet)
            async with asyncio.timeout(self._limits.unread_s):
                await self._writer.drain()

    def deliver(self, topic: str, data: bytes, mqtt_qos: int, *, retained: bool) -> None:
        """Write a message to the client, in the order of the calls; no message is resent."""
        if self.waiting_bytes > self.limits.waiting_bytes:
            self.put_out_unread()
            return
        packet_id = self.session.next_packet_id if mqtt_qos else None
        self._send(PublishPacket.build(topic, data, packet_id, False, mqtt_qos, retained))

    @property
    def waiting_bytes(self) -> int:
        """Written bytes that the client has not received yet."""
        return self._writer.waiting_bytes

    def put_out_unread(self) -> None:
        """Disconnect the client because too much waits for it."""
        log.warning("client does not read, disconnected", extra={"client": self.place})
        self.disconnect()

    def disconnect(self) -> None:
        """Close the connection now."""
        self._writer.abort()

    async def _next_packet(self, silence_s: float) -> MQTTPacket | None:
        async with asyncio.timeout(silence_s):
            header = await MQTTFixedHeader.from_stream(self._reader)
        if header is None:
            return None
        size = header.remaining_length
        is_message = header.packet_type == PUBLISH
        if size > (self._limits.publish_bytes if is_message else self._limits.packet_bytes):
            raise MQTTError(f"a packet of {size} bytes")
        await self._usage.pay(self.user_name, 1 + size / _BYTES_PER_COUNT)
        async with asyncio.timeout(self._limits.packet_s):
            return await packet_class(header).from_stream(self._reader, fixed_header=header)

    async def _handle(self, packet: MQTTPacket) -> None:
        match packet:
            case PublishPacket():
                self._publish(packet)
            case PubackPacket():
                pass  # no message is resent, so none waits for its PUBACK
            case PingReqPacket():
                self._send(PingRespPacket.build())
            case SubscribePacket():
                await self._subscribe(packet)
            case UnsubscribePacket():
                self._traffic.unsubscribe(self, packet.payload.topics)
                self._send(UnsubackPacket.build(packet.variable_header.packet_id))
            case _:
                raise MQTTError(f"unexpected {type(packet).__name__}")

    async def _subscribe(self, packet: SubscribePacket) -> None:
        filters = [topic_filter for topic_filter, _ in packet.payload.topics]
        granted = self._traffic.subscribe(self, packet.payload.topics)
        codes = [NOT_A_FILTER if mqtt_qos is None else mqtt_qos for mqtt_qos in granted]
        self._send(SubackPacket.build(packet.variable_header.packet_id, codes))
        for topic_filter, mqtt_qos in zip(filters, granted, strict=True):
            if mqtt_qos is not None:
                sent = self._traffic.send_retained(self, topic_filter, mqtt_qos)
                await self._usage.pay(self.user_name, 1 + sent / _RETAINED_PER_COUNT)

    def _publish(self, packet: PublishPacket) -> None:
        if packet.qos > 1:
            raise MQTTError("mqtt_qos 2 is not supported")
        self._traffic.publish(self, packet)
        if packet.qos == 1:
            self._send(PubackPacket.build(packet.packet_id))

    def _send(self, packet: MQTTPacket) -> None:
        self._writer.write(packet.to_bytes())


def refuse(writer: ClientWriter, code: int) -> None:
    """Answer a client that it may not connect, with a return code of CONNACK."""
    writer.write(ConnackPacket.build(0, code).to_bytes())
