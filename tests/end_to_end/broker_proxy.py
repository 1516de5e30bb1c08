"""A proxy between a drone and the broker that can cut connections and hold messages back."""

import contextlib
import socket
import threading
from collections.abc import Iterator
from types import TracebackType
from typing import Self

_PUBLISH = 3


class BrokerProxy:
    """Listens on its own port and forwards everything in both directions."""

    def __init__(self, broker: tuple[str, int]) -> None:
        self._broker = broker
        self._lock = threading.Lock()
        self._is_cut = False
        self._holds: bytes | None = None
        self._held: list[tuple[socket.socket, bytes]] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._ends: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._listen)]

    @property
    def url(self) -> str:
        """Where drones connect."""
        return f"mqtt://127.0.0.1:{self._listener.getsockname()[1]}"

    def hold(self, kind: str) -> None:
        """Hold back messages of one kind from now on: "acks" or "instructions"."""
        with self._lock:
            self._holds = f"/{kind}".encode()

    def release(self) -> None:
        """Forward the held messages and all later ones."""
        with self._lock:
            self._holds = None
            for receiver, packet in self._held:
                with contextlib.suppress(OSError):
                    receiver.sendall(packet)
            self._held.clear()

    def cut(self) -> None:
        """Break all connections without a DISCONNECT and refuse new ones."""
        with self._lock:
            self._is_cut = True
            for end in self._ends:
                _hang_up(end)
            self._ends.clear()

    def restore(self) -> None:
        """Accept connections again."""
        with self._lock:
            self._is_cut = False

    def __enter__(self) -> Self:
        self._threads[0].start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.cut()
        _hang_up(self._listener)
        for thread in self._threads:
            thread.join()

    def _listen(self) -> None:
        while True:
            try:
                drone, _ = self._listener.accept()
            except OSError:
                return
            with self._lock:
                if self._is_cut:
                    _hang_up(drone)
                else:
                    self._join(drone)

    def _join(self, drone: socket.socket) -> None:
        broker = socket.create_connection(self._broker)
        self._ends += [drone, broker]
        threads = [
            threading.Thread(target=self._forward, args=(drone, broker)),
            threading.Thread(target=self._forward, args=(broker, drone)),
        ]
        self._threads += threads
        for thread in threads:
            thread.start()

    def _forward(self, sender: socket.socket, receiver: socket.socket) -> None:
        with contextlib.suppress(OSError):
            for packet in _packets(sender):
                with self._lock:
                    if self._holds is not None and _is_about(self._holds, packet):
                        self._held.append((receiver, packet))
                    else:
                        receiver.sendall(packet)
        _hang_up(receiver)


def _packets(end: socket.socket) -> Iterator[bytes]:
    """MQTT packets in order: a type byte, a length of one to four bytes, then that many bytes."""
    with end.makefile("rb") as stream:
        while head := stream.read(1):
            length, shift, more = 0, 0, True
            while more:
                byte = stream.read(1)
                if not byte:
                    return
                head += byte
                length |= (byte[0] & 0x7F) << shift
                shift, more = shift + 7, bool(byte[0] & 0x80)
            yield head + stream.read(length)


def _is_about(topic: bytes, packet: bytes) -> bool:
    return packet[0] >> 4 == _PUBLISH and topic in packet[:200]


def _hang_up(end: socket.socket) -> None:
    with contextlib.suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)
    end.close()
