"""A socket for paho that makes few system calls: one for everything to read or to write.

Paho reads a packet in three pieces and writes each packet by itself. A system call takes longer
than everything else that is done for a small packet.
"""

import select
import socket
import ssl
from typing import Final

#: The most bytes of one read, and of packets that wait to be written.
_MOST_BYTES: Final = 64 * 1024

_NOT_NOW: Final = (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError)


class BufferedSocket:
    """A connected, non-blocking socket, as paho uses one; only `fill` and `flush` do anything.

    Notes
    -----
    Data that `send` has accepted counts as written. It is as safe as in the system's own buffer:
    both are lost with the connection. A sender that needs to know waits for the PUBACK.
    """

    def __init__(self, sock: socket.socket) -> None:
        self._sock = sock
        self._read = b""
        self._consumed = 0  # how much of it paho has read
        self._unsent = bytearray()
        self._end: OSError | bytes | None = None  # what paho gets when everything is read
        #: Says whether more TLS records have arrived: each read gives one record, 16 KiB at most.
        self._records = _arrivals(sock) if isinstance(sock, ssl.SSLSocket) else None

    @property
    def has_unread(self) -> bool:
        """Whether paho has something to read without a system call; the end counts too."""
        return self._consumed < len(self._read) or self._end is not None

    @property
    def has_unsent(self) -> bool:
        """Whether some data still waits to be written."""
        return bool(self._unsent)

    def fill(self) -> None:
        """Read what has arrived; call it when the socket is readable."""
        try:
            self._keep(self._sock.recv(_MOST_BYTES))
            while self._records is not None and self._has_room and self._records.poll(0):
                self._keep(self._sock.recv(_MOST_BYTES))
        except _NOT_NOW:
            return
        except OSError as error:
            self._end = error

    @property
    def _has_room(self) -> bool:
        """Whether to read more now: the rest of the process needs its turn too."""
        return self._end is None and len(self._read) < _MOST_BYTES

    def _keep(self, data: bytes) -> None:
        self._read = self._read[self._consumed :] + data
        self._consumed = 0
        if not data:
            self._end = data

    def flush(self) -> None:
        """Write as much as the system accepts; after a failure paho reads the end."""
        try:
            while self._unsent:
                del self._unsent[: self._sock.send(self._unsent)]
        except _NOT_NOW:
            return
        except OSError as error:
            self._unsent.clear()
            self._end = error

    def recv(self, size: int) -> bytes:
        """At most `size` of the bytes that `fill` has read."""
        start = self._consumed
        if start < len(self._read):
            self._consumed = min(start + size, len(self._read))
            return self._read[start : self._consumed]
        if isinstance(self._end, OSError):
            raise self._end
        if self._end is None:
            raise BlockingIOError
        return self._end

    def send(self, data: bytes | bytearray) -> int:
        """Accept a packet, unless too much still waits to be written."""
        if len(self._unsent) >= _MOST_BYTES:
            self.flush()
        if len(self._unsent) >= _MOST_BYTES:
            raise BlockingIOError
        self._unsent += data
        return len(data)

    def close(self) -> None:
        """Write what can still be written, usually a goodbye, and close."""
        if self.fileno() != -1:
            self.flush()
        self._sock.close()

    def fileno(self) -> int:
        """The file descriptor, -1 once closed."""
        return self._sock.fileno()

    def setblocking(self, flag: bool) -> None:
        """Block or not, as paho asks; it never asks to block."""
        self._sock.setblocking(flag)


def _arrivals(sock: socket.socket) -> select.poll:
    arrivals = select.poll()
    arrivals.register(sock, select.POLLIN)
    return arrivals
