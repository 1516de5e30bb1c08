"""One connection to a broker: paho parses the packets, asyncio serves the socket."""

import asyncio
import ssl
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode
from paho.mqtt.reasoncodes import ReasonCode

from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.address import BrokerAddress
from skyway.runtime.mqtt.buffered_socket import BufferedSocket

if TYPE_CHECKING:
    from paho.mqtt.client import SocketLike

#: Stands for the packet id of the broker's answer to CONNECT, which has none; ids start at 1.
_CONNACK = 0

Arrival = Callable[[str, bytes, bool], None]

#: Checks within one keepalive while a ping is due. So the ping, or the end of a connection without
#: an answer, is late by at most a fifth of the keepalive.
_CHECKS: Final = 5


@dataclass(frozen=True, slots=True)
class RawMessage:
    """A topic name and a payload as they go over the wire."""

    name: str
    payload: bytes
    mqtt_qos: int
    retained: bool


@dataclass(frozen=True, slots=True)
class Login:
    """How a client introduces itself."""

    client_id: str
    user_name: str
    password: str = field(repr=False)
    keepalive_s: int


class PahoClient(Client):
    """A paho client on a socket that asyncio has already connected (paho's own connect blocks)."""

    opened: BufferedSocket

    def _create_socket(self) -> BufferedSocket:
        return self.opened


def new_paho_client(login: Login, will: RawMessage | None) -> PahoClient:
    """A client that is not connected and never reconnects by itself."""
    paho = PahoClient(CallbackAPIVersion.VERSION2, login.client_id, reconnect_on_failure=False)
    paho.username_pw_set(login.user_name, login.password)
    paho.max_inflight_messages = 0
    if will is not None:
        paho.will_set(will.name, will.payload, will.mqtt_qos, will.retained)
    return paho


class MqttConnection:
    """A single connection, from CONNECT to its loss; it never connects again.

    Each connection has a paho client of its own. The sender of an unacknowledged message gets an
    error, and nothing is sent by itself after a reconnect.
    """

    def __init__(self, login: Login, *, will: RawMessage | None, on_message: Arrival) -> None:
        self._loop = asyncio.get_running_loop()
        self._on_message = on_message
        self._waiters: dict[int, asyncio.Future[None]] = {}
        self._is_watching_writes = False
        self._keepalive_check: asyncio.TimerHandle | None = None
        self._received_s = self._sent_s = self._loop.time()
        #: Done as soon as the connection is lost, with the reason.
        self.lost: asyncio.Future[str] = self._loop.create_future()
        self._keepalive_s = login.keepalive_s
        self._paho = self._make_paho(login, will)

    def _make_paho(self, login: Login, will: RawMessage | None) -> PahoClient:
        paho = new_paho_client(login, will)
        paho.on_connect = lambda _c, _u, _f, reason, _p: self._on_connack(reason)
        paho.on_disconnect = lambda _c, _u, _f, reason, _p: self._has_lost(str(reason))
        paho.on_subscribe = lambda _c, _u, mid, _r, _p: self._acknowledged(mid)
        paho.on_publish = lambda _c, _u, mid, _r, _p: self._acknowledged(mid)
        paho.on_message = self._arrived
        paho.on_socket_open = lambda _c, _u, sock: self._loop.add_reader(sock, self._read)
        paho.on_socket_close = lambda _c, _u, sock: self._stop_watching(sock)
        paho.on_socket_register_write = lambda _c, _u, _s: self._write_soon()
        return paho

    async def open(self, broker: BrokerAddress, tls: ssl.SSLContext | None = None) -> None:
        """Connect to the broker, introduce ourselves and wait for its answer.

        Raises
        ------
        MqttUnavailable
            The broker refused us or hung up.
        OSError
            No broker listens there.
        """
        self._paho.opened = BufferedSocket(await broker.open_socket(tls))
        self._paho.connect(broker.host, broker.port, keepalive=self._keepalive_s)
        self._check_keepalive()
        await self._answer_to(_CONNACK)

    async def subscribe(self, filters: Mapping[str, int]) -> None:
        """Subscribe to these filters, each with its `mqtt_qos`, and wait for the SUBACK."""
        rc, mid = self._paho.subscribe(list(filters.items()))
        if mid is None:
            raise MqttUnavailable(f"not subscribed: {rc.name}")
        await self._answer_to(mid)

    async def publish(self, message: RawMessage) -> None:
        """Return after the PUBACK, or for `mqtt_qos` 0 once the message is written to the socket.

        Raises
        ------
        MqttUnavailable
            The connection is lost before that.
        """
        info = self._paho.publish(message.name, message.payload, message.mqtt_qos, message.retained)
        if info.rc != MQTTErrorCode.MQTT_ERR_SUCCESS:
            raise MqttUnavailable(f"not sent: {info.rc.name}")
        await self._answer_to(info.mid)

    async def lost_or(self, event: asyncio.Event) -> None:
        """Return once the connection is lost or the event is set."""
        happened = asyncio.create_task(event.wait())
        try:
            await asyncio.wait((self.lost, happened), return_when=asyncio.FIRST_COMPLETED)
        finally:
            happened.cancel()

    def close(self) -> None:
        """Say goodbye, so that the broker does not send the last will, and close the socket."""
        if not self.lost.done():
            self._paho.disconnect()
            self._paho.loop_write()
        # The socket is still open when the goodbye did not fit into its buffer.
        self._close_socket()
        self._has_lost("closed by this side")

    def drop(self) -> None:
        """Close the socket without a goodbye, as a lost radio does: the broker sends the will."""
        self._close_socket()
        self._has_lost("dropped by this side")

    def _close_socket(self) -> None:
        sock = self._paho.socket()
        if sock is not None:
            self._stop_watching(sock)
            sock.close()

    async def _answer_to(self, mid: int) -> None:
        """Return when the broker has answered the packet with this id."""
        if self.lost.done():
            raise MqttUnavailable(f"connection lost: {self.lost.result()}")
        waiter: asyncio.Future[None] = self._loop.create_future()
        self._waiters[mid] = waiter
        try:
            await waiter
        finally:
            self._waiters.pop(mid, None)

    def _acknowledged(self, mid: int) -> None:
        waiter = self._waiters.get(mid)
        if waiter is not None and not waiter.done():
            waiter.set_result(None)

    def _on_connack(self, reason: ReasonCode) -> None:
        if reason.is_failure:
            self._has_lost(f"refused by the broker: {reason}")
        else:
            self._acknowledged(_CONNACK)

    def _arrived(self, _client: Client, _data: object, message: MQTTMessage) -> None:
        self._on_message(message.topic, bytes(message.payload), message.retain)

    def _has_lost(self, reason: str) -> None:
        """Give every waiting call the error that the connection is lost."""
        if self.lost.done():
            return
        self.lost.set_result(reason)
        if self._keepalive_check is not None:
            self._keepalive_check.cancel()
        for waiter in self._waiters.values():
            if not waiter.done():
                waiter.set_exception(MqttUnavailable(f"connection lost: {reason}"))

    def _read(self) -> None:
        self._paho.opened.fill()
        self._read_on()

    def _read_on(self) -> None:
        """Let paho read everything: the selector does not know what is buffered."""
        self._received_s = self._loop.time()
        while self._paho.opened.has_unread and not self.lost.done():
            self._paho.loop_read()

    def _write_soon(self) -> None:
        """Write after the present callback: packets that are made together are sent together."""
        self._loop.call_soon(self._write)

    def _write(self) -> None:
        """Write now; ask the selector only when the socket accepts no more."""
        self._paho.loop_write()
        sock = self._paho.opened
        if self._paho.socket() is None:
            return
        sock.flush()
        self._sent_s = self._loop.time()
        if sock.has_unsent or self._paho.want_write():
            self._watch_writes(sock)
        else:
            self._stop_watching_writes(sock)
        if sock.has_unread:  # that the connection is lost
            self._read_on()

    def _watch_writes(self, sock: BufferedSocket) -> None:
        if not self._is_watching_writes:
            self._is_watching_writes = True
            self._loop.add_writer(sock, self._write)

    def _stop_watching(self, sock: "SocketLike") -> None:
        if sock.fileno() != -1:
            self._stop_watching_writes(sock)
            self._loop.remove_reader(sock)

    def _stop_watching_writes(self, sock: "SocketLike") -> None:
        if self._is_watching_writes:
            self._is_watching_writes = False
            self._loop.remove_writer(sock)

    def _check_keepalive(self) -> None:
        """Let paho send a ping if one is due, and check again when the next one may be due."""
        if self.lost.done():
            return
        self._paho.loop_misc()
        check_s = next_check_s(
            self._loop.time(),
            received_s=self._received_s,
            sent_s=self._sent_s,
            keepalive_s=self._keepalive_s,
        )
        self._keepalive_check = self._loop.call_at(check_s, self._check_keepalive)


def next_check_s(now_s: float, *, received_s: float, sent_s: float, keepalive_s: float) -> float:
    """When to check the connection again; all times are those of the event loop's clock.

    `received_s` and `sent_s` are when something was last received and sent. Before a keepalive of
    silence has passed there is nothing to do. A fleet has a connection per drone, so most wake-ups
    would be these checks.
    """
    return max(min(received_s, sent_s) + keepalive_s, now_s + keepalive_s / _CHECKS)
