"""amqtt's broker with its holes closed.

Measured on 0.12.1, and closed here: a connecting client was sent everything retained under
anybody's subscriptions; a wrong password under a client's id made that client deaf; last wills
went past the rights; a subscription during a broadcast killed connections; silent clients stayed.

As Mosquitto does: SUBSCRIBE is granted and rights decide what is delivered; a publish that is not
allowed ends the connection (here without a PUBACK, so that nobody believes it was taken); an
account that is removed, or whose password changes, is put out, and nobody else is. Unlike it:
every session is a clean one, and mqtt_qos 2 is granted as 1.
"""

import asyncio
import logging
import socket

from amqtt.adapters import ReaderAdapter, WriterAdapter
from amqtt.broker import Broker, Server
from amqtt.contexts import BrokerConfig, ListenerConfig
from amqtt.errors import AMQTTError, MQTTError, NoDataError
from amqtt.mqtt.protocol.broker_handler import BrokerProtocolHandler
from amqtt.mqtt.publish import PublishPacket
from amqtt.session import Session

from skyway.contracts.broker_rules import BrokerRules
from skyway_broker.client import Client, refuse
from skyway_broker.gate import Gate, place_of
from skyway_broker.retained import Retained
from skyway_broker.streams import ClientReader, ClientWriter
from skyway_broker.subscriptions import Subscriptions, is_filter

log = logging.getLogger(__name__)

#: Seconds that a connection may take to introduce itself.
_INTRODUCTION_S = 10.0

#: Seconds between two looks at the password file.
_POLL_S = 0.1

#: Connections that may wait to be accepted: a fleet reconnects all at once.
_BACKLOG = 1024


class HardenedBroker(Broker):  # type: ignore[misc] # amqtt has no types
    """A broker on one listening socket, for the accounts of a password file."""

    def __init__(self, listener: socket.socket, *, gate: Gate, rules: BrokerRules) -> None:
        # Naming no plugins drops amqtt's defaults, among them the one that lets anybody in.
        super().__init__(BrokerConfig(listeners={"default": ListenerConfig()}, plugins={}))
        self._listener = listener
        self._gate = gate
        self._rules = rules
        self._clients: dict[str, Client] = {}
        self._wanted = Subscriptions()
        self._kept = Retained()
        self._connections: set[asyncio.Task[None]] = set()
        self._polling: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Listen, and watch the password file from now on."""
        self._gate.refresh()
        await super().start()
        self._polling = asyncio.create_task(self._poll_accounts())

    async def shutdown(self) -> None:
        """Put everybody out without sending last wills, and stop listening."""
        tasks = [*self._connections, *([self._polling] if self._polling else [])]
        self._clients.clear()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await super().shutdown()

    async def _start_listeners(self) -> None:
        # asyncio sets TCP_NODELAY on what it accepts; without it an answer takes 44 to 88 ms.
        server = await asyncio.start_server(self._accept, sock=self._listener, backlog=_BACKLOG)
        self._servers["default"] = Server("default", server)

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        if task is not None:
            self._connections.add(task)
            task.add_done_callback(self._connections.discard)
        ends = ClientReader(reader), ClientWriter(writer)
        try:
            await self._converse(*ends)
        except asyncio.CancelledError:
            ends[1].abort()
        except Exception as error:  # noqa: BLE001 - the outermost loop of one connection
            log.warning("connection broke", extra={"reason": repr(error)})
        finally:
            await ends[1].close()

    async def _converse(self, reader: ClientReader, writer: ClientWriter) -> None:
        """Let one client in, or not, and serve it until it leaves."""
        session = await self._introduction(reader, writer)
        if session is None:
            return
        # An account just made comes in, and one just removed does not, before the next poll.
        self._look_at_accounts()
        if not self._gate.admits(session.username, session.password):
            # Nothing of anybody else was touched before this line.
            log.info("client refused", extra={"user_name": session.username})
            refuse(writer)
            return
        place = place_of(session.username, session.client_id)
        client = Client(session, place=place, reader=reader, writer=writer, traffic=self)
        self._enter(client)
        has_left = False
        try:
            has_left = await client.serve()
        except (AMQTTError, MQTTError, NoDataError, TimeoutError, OSError) as error:
            reason = str(error) or type(error).__name__
            log.info("client put out", extra={"client": place, "reason": reason})
        finally:
            self._leave(client, has_left=has_left)

    async def _introduction(self, reader: ReaderAdapter, writer: WriterAdapter) -> Session | None:
        """What a client says of itself in CONNECT; None when it says nothing sensible."""
        try:
            async with asyncio.timeout(_INTRODUCTION_S):
                _, session = await BrokerProtocolHandler.init_from_connect(
                    reader, writer, self.plugins_manager
                )
        except (AMQTTError, MQTTError, NoDataError, TimeoutError, OSError) as error:
            log.info("no sensible CONNECT", extra={"reason": str(error)})
            return None
        return session

    def _enter(self, client: Client) -> None:
        """Give the client its place, and put out whoever had it."""
        former = self._clients.get(client.place)
        if former is not None:
            log.info("client replaced by its next connection", extra={"client": client.place})
            self._leave(former, has_left=False)
            former.put_out()
        self._clients[client.place] = client

    def _leave(self, client: Client, *, has_left: bool) -> None:
        """Forget a client, once; its last will is sent if it left without a goodbye."""
        if self._clients.get(client.place) is not client:
            return
        del self._clients[client.place]
        self._wanted.drop(client.place)
        session = client.session
        if has_left or not session.will_flag:
            return
        if self._rules.may_write(client.user_name, session.will_topic):
            qos = min(session.will_qos or 0, 1)
            will = bytes(session.will_message or b"")
            self._distribute(session.will_topic, will, qos, retained=bool(session.will_retain))
        else:
            log.warning("last will not allowed", extra={"client": client.place})

    def publish(self, client: Client, packet: PublishPacket) -> None:
        """Distribute a client's message, or raise `MQTTError` if it may not write there."""
        topic = packet.topic_name
        if not topic or not self._rules.may_write(client.user_name, topic):
            raise MQTTError(f"not allowed to publish on {topic}")
        self._distribute(topic, bytes(packet.data), packet.qos, retained=packet.retain_flag)

    def subscribe(self, client: Client, filters: list[tuple[str, int]]) -> list[int | None]:
        """Subscribe to all that are filters: rights decide at delivery."""
        granted: list[int | None] = []
        for wanted, mqtt_qos in filters:
            granted.append(min(mqtt_qos, 1) if is_filter(wanted) else None)
            if is_filter(wanted):
                self._wanted.add(client.place, wanted, min(mqtt_qos, 1))
        return granted

    def send_retained(self, client: Client, wanted: str, mqtt_qos: int) -> None:
        """Send what is retained under a filter and may be read by this client."""
        for topic, data, kept_qos in self._kept.under(wanted):
            if self._rules.may_read(client.user_name, topic):
                client.deliver(topic, data, min(kept_qos, mqtt_qos), retained=True)

    def unsubscribe(self, client: Client, filters: list[str]) -> None:
        """Forget these filters."""
        for wanted in filters:
            self._wanted.remove(client.place, wanted)

    def _distribute(self, topic: str, data: bytes, mqtt_qos: int, *, retained: bool) -> None:
        if retained:
            self._kept.keep(topic, data, mqtt_qos)
        for place, granted in self._wanted.matching(topic).items():
            client = self._clients.get(place)
            if client is not None and self._rules.may_read(client.user_name, topic):
                client.deliver(topic, data, min(mqtt_qos, granted), retained=False)

    async def _poll_accounts(self) -> None:
        while True:
            await asyncio.sleep(_POLL_S)
            self._look_at_accounts()

    def _look_at_accounts(self) -> None:
        """Put out at once whoever is not in the password file any more."""
        if not self._gate.refresh():
            return
        for client in tuple(self._clients.values()):
            if not self._gate.admits(client.user_name, client.session.password):
                log.info("account revoked", extra={"client": client.place})
                self._leave(client, has_left=False)
                client.put_out()
