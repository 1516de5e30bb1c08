"""A socket for paho that asks the system seldom: once for all there is to read or to write.

Paho reads a packet in three pieces, and writes each packet by itself. A system call takes longer
than all else that is done for a small packet.
"""

import select
import socket
import ssl
from typing import Final

#: Most that is read at once, and taken from paho before the system has taken any of it.
_MOST_BYTES: Final = 64 * 1024

_NOT_NOW: Final = (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError)


class BufferedSocket:
    """A connected, non-blocking socket, as paho uses one; only `fill` and `flush` do anything.

    Notes
    -----
    What `send` has taken counts as written. It is as safe as in the system's own buffer: both are
    lost with the connection, and whoever needs to know waits for the PUBACK.
    """

    def __init__(self, sock: socket.socket) -> None:
        self._sock = sock
        self._read = b""
        self._taken = 0  # how much of that paho has
        self._unsent = bytearray()
        self._end: OSError | bytes | None = None  # what paho is answered when all is read
        #: Asked for further records: TLS gives one at a time, a whole one, of 16 KiB at most.
        self._records = _arrivals(sock) if isinstance(sock, ssl.SSLSocket) else None

    @property
    def has_unread(self) -> bool:
        """Whether paho has something to read without asking the system, be it the end."""
        return self._taken < len(self._read) or self._end is not None

    @property
    def has_unsent(self) -> bool:
        """Whether the system has not taken all yet."""
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
        """Whether to ask for more: others of this process want their turn too."""
        return self._end is None and len(self._read) < _MOST_BYTES

    def _keep(self, data: bytes) -> None:
        self._read = self._read[self._taken :] + data
        self._taken = 0
        if not data:
            self._end = data

    def flush(self) -> None:
        """Write what `send` took, as far as the system takes it; a failure is read as the end."""
        try:
            while self._unsent:
                del self._unsent[: self._sock.send(self._unsent)]
        except _NOT_NOW:
            return
        except OSError as error:
            self._unsent.clear()
            self._end = error

    def recv(self, size: int) -> bytes:
        """At most so many of the bytes that `fill` has read."""
        start = self._taken
        if start < len(self._read):
            self._taken = min(start + size, len(self._read))
            return self._read[start : self._taken]
        if isinstance(self._end, OSError):
            raise self._end
        if self._end is None:
            raise BlockingIOError
        return self._end

    def send(self, data: bytes | bytearray) -> int:
        """Take a packet, unless the system is behind with what was taken before."""
        if len(self._unsent) >= _MOST_BYTES:
            self.flush()
        if len(self._unsent) >= _MOST_BYTES:
            raise BlockingIOError
        self._unsent += data
        return len(data)

    def close(self) -> None:
        """Write what can still be written, a goodbye mostly, and close."""
        if self.fileno() != -1:
            self.flush()
        self._sock.close()

    def fileno(self) -> int:
        """The file descriptor, -1 once closed."""
        return self._sock.fileno()

    def setblocking(self, flag: bool) -> None:
        """Block or not, as paho asks; it never wants to."""
        self._sock.setblocking(flag)


def _arrivals(sock: socket.socket) -> select.poll:
    arrivals = select.poll()
    arrivals.register(sock, select.POLLIN)
    return arrivals
