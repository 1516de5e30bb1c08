"""A drone's way to the broker on which its acks can be kept back, and nothing else."""

import contextlib
import socket
import threading
from collections.abc import Iterator
from types import TracebackType
from typing import Self

_PUBLISH = 3


class LateAcks:
    """Listens on a port of its own and passes everything on; acks wait while they are held."""

    def __init__(self, broker: tuple[str, int]) -> None:
        self._broker = broker
        self._lock = threading.Lock()
        self._holds = False
        self._held: list[tuple[socket.socket, bytes]] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._sockets: list[socket.socket] = [self._listener]
        self._threads = [threading.Thread(target=self._listen)]

    @property
    def port(self) -> int:
        """Where drones connect."""
        port: int = self._listener.getsockname()[1]
        return port

    def hold(self) -> None:
        """Keep acks back from now on."""
        with self._lock:
            self._holds = True

    def let_go(self) -> None:
        """Pass on what was held, and all that follows."""
        with self._lock:
            self._holds = False
            for broker, packet in self._held:
                with contextlib.suppress(OSError):
                    broker.sendall(packet)
            self._held.clear()

    def __enter__(self) -> Self:
        self._threads[0].start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.let_go()
        for end in self._sockets:
            _hang_up(end)
        for thread in self._threads:
            thread.join()

    def _listen(self) -> None:
        while True:
            try:
                drone, _ = self._listener.accept()
            except OSError:
                return
            broker = socket.create_connection(self._broker)
            self._sockets += [drone, broker]
            ways = [
                threading.Thread(target=self._pass_up, args=(drone, broker)),
                threading.Thread(target=_pass_down, args=(broker, drone)),
            ]
            self._threads += ways
            for way in ways:
                way.start()

    def _pass_up(self, drone: socket.socket, broker: socket.socket) -> None:
        with contextlib.suppress(OSError):
            for packet in _packets(drone):
                with self._lock:
                    if self._holds and _is_ack(packet):
                        self._held.append((broker, packet))
                    else:
                        broker.sendall(packet)
        _hang_up(broker)


def _pass_down(broker: socket.socket, drone: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while some := broker.recv(65_536):
            drone.sendall(some)
    _hang_up(drone)


def _packets(end: socket.socket) -> Iterator[bytes]:
    """MQTT packets as they come: a byte of type, a length of up to four bytes, so many bytes."""
    with end.makefile("rb") as stream:
        while head := stream.read(1):
            length, shift = 0, 0
            while not shift or head[-1] & 0x80:
                head += stream.read(1)
                length |= (head[-1] & 0x7F) << shift
                shift += 7
            yield head + stream.read(length)


def _is_ack(packet: bytes) -> bool:
    return packet[0] >> 4 == _PUBLISH and b"/acks" in packet[:200]


def _hang_up(end: socket.socket) -> None:
    with contextlib.suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)
    end.close()
