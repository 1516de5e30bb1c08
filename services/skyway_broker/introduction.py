"""The CONNECT of a client: bounded, and answered when its version of MQTT is another one."""

from typing import Any, Final

from amqtt.adapters import BufferReader, ReaderAdapter
from amqtt.errors import MQTTError
from amqtt.mqtt.connack import UNACCEPTABLE_PROTOCOL_VERSION, ConnackPacket
from amqtt.mqtt.packet import CONNECT, MQTTFixedHeader
from amqtt.mqtt.protocol.broker_handler import BrokerProtocolHandler
from amqtt.session import Session

from skyway_broker.client import ClientWriter

#: The version byte of MQTT 3.1.1, the only version of this broker, and of MQTT 5.
_VERSION_3_1_1, _VERSION_5 = 4, 5

#: CONNACK of MQTT 5 "Unsupported Protocol Version", without properties.
_REFUSED_5: Final = bytes((0x20, 3, 0, 0x84, 0))


async def read_introduction(
    reader: ReaderAdapter, writer: ClientWriter, plugins: Any, *, most_bytes: int
) -> Session:
    """The session that a client asks for.

    Raises
    ------
    MQTTError
        The first packet is no valid CONNECT of MQTT 3.1.1. Another version is answered first.
    """
    header = await MQTTFixedHeader.from_stream(reader)
    if header is None or header.packet_type != CONNECT:
        raise MQTTError("the first packet is no CONNECT")
    if header.remaining_length > most_bytes:
        raise MQTTError(f"a CONNECT of {header.remaining_length} bytes")
    body = await reader.read(header.remaining_length)
    _refuse_other_versions(body, writer)
    whole = BufferReader(bytes(header.to_bytes()) + body)
    _, session = await BrokerProtocolHandler.init_from_connect(whole, writer, plugins)
    return session


def _refuse_other_versions(body: bytes, writer: ClientWriter) -> None:
    length = int.from_bytes(body[:2], "big")
    name, version = body[2 : 2 + length], body[2 + length : 3 + length]
    if name not in (b"MQTT", b"MQIsdp") or not version:
        raise MQTTError("a CONNECT of another protocol")
    if version[0] == _VERSION_5:
        writer.write(_REFUSED_5)
    elif version[0] != _VERSION_3_1_1:
        writer.write(ConnackPacket.build(0, UNACCEPTABLE_PROTOCOL_VERSION).to_bytes())
    if version[0] != _VERSION_3_1_1:
        raise MQTTError(f"version {version[0]} of MQTT")
