"""Drones that only send, as cheaply as can be: MQTT 3.1.1 by hand, so that the broker is measured.

A client that keeps books of all it sends takes more time for a message than the broker does.
"""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

from skyway.errors import SkywayError

_CONNECT, _PUBLISH = 0x10, 0x30
_RETAIN, _MQTT_QOS_1 = 0x01, 0x02
#: User name, password, clean session.
_FLAGS: Final = 0xC2
_KEEPALIVE_S: Final = 600
_CONNACK: Final = bytes((0x20, 2, 0, 0))


class PlainSender:
    """One drone's connection; what the broker answers is read and forgotten."""

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self._writer = writer
        self._packet_id = 0

    def send(self, topic: str, payload: bytes) -> None:
        """Publish with mqtt_qos 0."""
        self._writer.write(_packet(_PUBLISH, _text(topic) + payload))

    def send_retained(self, topic: str, payload: bytes) -> None:
        """Publish with mqtt_qos 1, retained."""
        self._packet_id = self._packet_id % 0xFFFF + 1
        head = _text(topic) + self._packet_id.to_bytes(2, "big")
        self._writer.write(_packet(_PUBLISH | _MQTT_QOS_1 | _RETAIN, head + payload))


@asynccontextmanager
async def plain_sender(
    host: str, port: int, *, user_name: str, password: str
) -> AsyncIterator[PlainSender]:
    """Connect for the length of the block."""
    reader, writer = await asyncio.open_connection(host, port)
    try:
        hello = _text("MQTT") + bytes((4, _FLAGS)) + _KEEPALIVE_S.to_bytes(2, "big")
        hello += _text(user_name) + _text(user_name) + _text(password)
        writer.write(_packet(_CONNECT, hello))
        if await reader.read(len(_CONNACK)) != _CONNACK:
            raise SkywayError(f"the broker does not let {user_name} in")
        forgetting = asyncio.create_task(_forget(reader))
        try:
            yield PlainSender(writer)
        finally:
            forgetting.cancel()
    finally:
        writer.close()
        with contextlib.suppress(OSError):
            await writer.wait_closed()


async def _forget(reader: asyncio.StreamReader) -> None:
    while await reader.read(65_536):
        pass


def _text(text: str) -> bytes:
    encoded = text.encode()
    return len(encoded).to_bytes(2, "big") + encoded


def _packet(kind: int, body: bytes) -> bytes:
    """The packet; the length of what follows has seven bits a byte, the lowest first."""
    left, length = len(body), bytearray()
    while True:
        left, seven = divmod(left, 128)
        length.append(seven | (0x80 if left else 0))
        if not left:
            return bytes((kind, *length)) + body
