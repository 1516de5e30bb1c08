"""amqtt's reader and writer of a connection, made safe against clients that lie or hang."""

import asyncio

from amqtt.adapters import StreamReaderAdapter, StreamWriterAdapter
from amqtt.errors import MQTTError


class ClientReader(StreamReaderAdapter):  # type: ignore[misc] # amqtt has no types
    """amqtt's reader, which never reads "all there is" on a length that a client made up."""

    async def read(self, n: int = -1) -> bytes:
        """Exactly `n` bytes."""
        if n < 0:
            raise MQTTError("a length in a packet is wrong")
        data: bytes = await super().read(n)
        return data


class ClientWriter(StreamWriterAdapter):  # type: ignore[misc] # amqtt has no types
    """amqtt's writer, which also tells how much waits, and hangs up without waiting."""

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        super().__init__(writer)
        self._transport = writer.transport

    @property
    def waiting_bytes(self) -> int:
        """Bytes written that the client has not taken yet."""
        return self._transport.get_write_buffer_size()

    async def close(self) -> None:
        """Hang up once everything is written, without waiting for it."""
        self.is_closed = True
        self._transport.close()

    def abort(self) -> None:
        """Hang up now."""
        self.is_closed = True
        self._transport.abort()
