"""The embedded broker: amqtt with its security holes closed.

These faults were measured on amqtt 0.12.1 and are closed here. A connecting client received all
retained messages of other clients' subscriptions. A wrong password under a client's id cut off that
client. Last wills ignored the access rules. A subscription during a broadcast killed connections.
Silent clients stayed connected.

Like Mosquitto, this broker grants every SUBSCRIBE, and the access rules decide what it delivers. A
forbidden publish ends the connection, here without a PUBACK, so that no client counts it as
accepted. The accounts that may connect are those of the password file, read again when it changes.
When an account is removed or its password changes, only its own clients are disconnected.
Unlike Mosquitto, every session is a clean session, and mqtt_qos 2 is granted as 1.
"""

import asyncio
import logging
import socket
from pathlib import Path

from amqtt.adapters import ReaderAdapter, WriterAdapter
from amqtt.broker import Broker, Server
from amqtt.contexts import BrokerConfig, ListenerConfig
from amqtt.errors import AMQTTError, MQTTError, NoDataError
from amqtt.mqtt.protocol.broker_handler import BrokerProtocolHandler
from amqtt.mqtt.publish import PublishPacket
from amqtt.session import Session

from skyway.broker_setup.passwords import matches, read_password_file
from skyway.contracts.broker_rules import SERVICE_ACCOUNTS, BrokerRules
from skyway_broker.client import Client, ClientReader, ClientWriter, refuse
from skyway_broker.subscriptions import Retained, Subscriptions, is_filter

log = logging.getLogger(__name__)

#: Seconds that a connection may take to introduce itself.
_INTRODUCTION_S = 10.0

#: Seconds between two checks of the password file.
_POLL_S = 0.1

#: Connections that may wait to be accepted: a whole fleet reconnects at the same time.
_BACKLOG = 1024


class Gate:
    """The accounts of a password file; without a file there are no accounts."""

    def __init__(self, password_file: Path) -> None:
        self._file = password_file
        self._seen: tuple[int, int, int] | None = None
        self._accounts: dict[str, str] = {}

    def refresh(self) -> bool:
        """Read the file if it was replaced; True when it was read.

        A file that is missing for a moment changes nothing: the accounts stay.
        """
        try:
            status = self._file.stat()
            seen = (status.st_ino, status.st_mtime_ns, status.st_size)
            if seen == self._seen:
                return False
            self._accounts = read_password_file(self._file)
        except OSError as error:
            if self._seen is not None:
                log.warning("password file unreadable", extra={"reason": str(error)})
            return False
        self._seen = seen
        log.info("accounts read", extra={"accounts": len(self._accounts)})
        return True

    def admits(self, user_name: str | None, password: str | None) -> bool:
        """Whether this account exists and has this password."""
        if not user_name or password is None:
            return False
        hashed = self._accounts.get(user_name)
        return hashed is not None and matches(password, hashed)


def place_of(user_name: str, client_id: str) -> str:
    """The place of a client; a new client with the same place disconnects the previous one.

    A drone and a customer have one place each, for all client ids. The replicas of a service have
    different client ids, and so different places. No account can use the place of another.
    """
    return f"{user_name}/{client_id}" if user_name in SERVICE_ACCOUNTS else user_name


class HardenedBroker(Broker):  # type: ignore[misc] # amqtt has no types
    """A broker on one listening socket, for the accounts of a password file."""

    def __init__(self, listener: socket.socket, *, gate: Gate, rules: BrokerRules) -> None:
        # An empty list of plugins removes amqtt's defaults; one of them accepts every client.
        super().__init__(BrokerConfig(listeners={"default": ListenerConfig()}, plugins={}))
        self._listener = listener
        self._gate = gate
        self._rules = rules
        self._clients: dict[str, Client] = {}
        self._clients_by_filter = Subscriptions()
        self._last_messages = Retained()
        self._connections: set[asyncio.Task[None]] = set()
        self._polling: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Listen, and watch the password file from now on."""
        self._gate.refresh()
        await super().start()
        self._polling = asyncio.create_task(self._poll_accounts())

    async def shutdown(self) -> None:
        """Disconnect all clients without sending last wills, and stop listening."""
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
        """Accept or refuse one client, and serve an accepted one until it leaves."""
        session = await self._introduction(reader, writer)
        if session is None:
            return
        # Not only at the next poll: a new account may connect now, and a removed one may not.
        self._check_accounts()
        if not self._gate.admits(session.username, session.password):
            # Up to this line no other client was affected.
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
            log.info("client disconnected", extra={"client": place, "reason": reason})
        finally:
            self._leave(client, has_left=has_left)

    async def _introduction(self, reader: ReaderAdapter, writer: WriterAdapter) -> Session | None:
        """The session of a client's CONNECT; None when there is no valid CONNECT."""
        try:
            async with asyncio.timeout(_INTRODUCTION_S):
                _, session = await BrokerProtocolHandler.init_from_connect(
                    reader, writer, self.plugins_manager
                )
        except (AMQTTError, MQTTError, NoDataError, TimeoutError, OSError) as error:
            log.info("no valid CONNECT", extra={"reason": str(error)})
            return None
        return session

    def _enter(self, client: Client) -> None:
        """Give the client its place, and disconnect the previous client there."""
        previous = self._clients.get(client.place)
        if previous is not None:
            log.info("client replaced by its next connection", extra={"client": client.place})
            self._leave(previous, has_left=False)
            previous.disconnect()
        self._clients[client.place] = client

    def _leave(self, client: Client, *, has_left: bool) -> None:
        """Remove a client, once; send its last will when it left without a DISCONNECT."""
        if self._clients.get(client.place) is not client:
            return
        del self._clients[client.place]
        self._clients_by_filter.drop(client.place)
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
        """Distribute a client's message, or raise `MQTTError` when the topic is forbidden."""
        topic = packet.topic_name
        if not topic or not self._rules.may_write(client.user_name, topic):
            raise MQTTError(f"not allowed to publish on {topic}")
        self._distribute(topic, bytes(packet.data), packet.qos, retained=packet.retain_flag)

    def subscribe(self, client: Client, filters: list[tuple[str, int]]) -> list[int | None]:
        """Subscribe to all valid filters; the access rules decide at each delivery."""
        granted: list[int | None] = []
        for topic_filter, mqtt_qos in filters:
            granted.append(min(mqtt_qos, 1) if is_filter(topic_filter) else None)
            if is_filter(topic_filter):
                self._clients_by_filter.add(client.place, topic_filter, min(mqtt_qos, 1))
        return granted

    def send_retained(self, client: Client, topic_filter: str, mqtt_qos: int) -> None:
        """Send the retained messages of a filter that this client may read."""
        for topic, data, kept_qos in self._last_messages.under(topic_filter):
            if self._rules.may_read(client.user_name, topic):
                client.deliver(topic, data, min(kept_qos, mqtt_qos), retained=True)

    def unsubscribe(self, client: Client, filters: list[str]) -> None:
        """Remove these filters."""
        for topic_filter in filters:
            self._clients_by_filter.remove(client.place, topic_filter)

    def _distribute(self, topic: str, data: bytes, mqtt_qos: int, *, retained: bool) -> None:
        if retained:
            self._last_messages.keep(topic, data, mqtt_qos)
        for place, granted in self._clients_by_filter.matching(topic).items():
            client = self._clients.get(place)
            if client is not None and self._rules.may_read(client.user_name, topic):
                client.deliver(topic, data, min(mqtt_qos, granted), retained=False)

    async def _poll_accounts(self) -> None:
        while True:
            await asyncio.sleep(_POLL_S)
            self._check_accounts()

    def _check_accounts(self) -> None:
        """Disconnect clients whose account is no longer in the password file."""
        if not self._gate.refresh():
            return
        for client in tuple(self._clients.values()):
            if not self._gate.admits(client.user_name, client.session.password):
                log.info("account revoked", extra={"client": client.place})
                self._leave(client, has_left=False)
                client.disconnect()
