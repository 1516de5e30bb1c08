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
`limits` says what one client, one account and one address may use.
"""

import asyncio
import itertools
import logging
import socket
from typing import Final

from amqtt.broker import Broker, Server
from amqtt.contexts import BrokerConfig, ListenerConfig
from amqtt.errors import AMQTTError, MQTTError, NoDataError
from amqtt.mqtt.connack import NOT_AUTHORIZED, SERVER_UNAVAILABLE
from amqtt.session import Session

from skyway.contracts.broker_rules import SERVICE_ACCOUNTS, BrokerRules
from skyway.runtime.limits import network_of
from skyway_broker.client import Client, ClientReader, ClientWriter, refuse
from skyway_broker.door import Door
from skyway_broker.gate import Gate, TooManyAttempts, WrongPasswords
from skyway_broker.introduction import read_introduction
from skyway_broker.limits import Limits
from skyway_broker.messages import Messages
from skyway_broker.usage import Usage

_TRY_LATER: Final[int] = SERVER_UNAVAILABLE
_NOT_AUTHORIZED: Final[int] = NOT_AUTHORIZED

log = logging.getLogger(__name__)

#: Seconds between two checks of the password file.
_POLL_S = 0.1
#: Checks of the password file between two looks at what waits for slow readers.
_POLLS_PER_LOOK = 10

#: Connections that may wait to be accepted: a whole fleet reconnects at the same time.
_BACKLOG = 1024


def place_of(user_name: str, client_id: str) -> str:
    """The place of a client; a new client with the same place disconnects the previous one.

    A drone and a customer have one place each, for all client ids. The replicas of a service have
    different client ids, and so different places. No account can use the place of another.
    """
    return f"{user_name}/{client_id}" if user_name in SERVICE_ACCOUNTS else user_name


class HardenedBroker(Broker):  # type: ignore[misc] # amqtt has no types
    """A broker on one listening socket, for the accounts of a password file."""

    def __init__(
        self,
        listener: socket.socket,
        *,
        gate: Gate,
        rules: BrokerRules,
        limits: Limits | None = None,
    ) -> None:
        # An empty list of plugins removes amqtt's defaults; one of them accepts every client.
        super().__init__(BrokerConfig(listeners={"default": ListenerConfig()}, plugins={}))
        self._listener = listener
        self._gate = gate
        self._limits = limits or Limits()
        self._usage = Usage(self._limits)
        self._door = Door(self._limits)
        self._wrong_passwords = WrongPasswords()
        self._clients: dict[str, Client] = {}
        self._messages = Messages(self._clients, rules=rules, limits=self._limits)
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
        peer = writer.get_extra_info("peername")
        address = network_of(peer[0]) if peer else ""
        if not self._door.enter(ends[1], address):
            ends[1].abort()
            return
        try:
            await self._converse(*ends, address=address)
        except asyncio.CancelledError:
            ends[1].abort()
        except Exception as error:  # noqa: BLE001 - the outermost loop of one connection
            log.warning("connection broke", extra={"reason": repr(error)})
        finally:
            self._door.leave(ends[1])
            await ends[1].close()

    async def _converse(self, reader: ClientReader, writer: ClientWriter, *, address: str) -> None:
        """Accept or refuse one client, and serve an accepted one until it leaves."""
        session = await self._introduction(reader, writer)
        if session is None:
            return
        refusal = await self._refusal(session, address)
        if refusal is not None:
            # Up to this line no other client was affected.
            log.info("client refused", extra={"user_name": session.username, "code": refusal})
            refuse(writer, refusal)
            return
        self._door.introduce(writer)
        client = Client(
            session,
            place=place_of(session.username, session.client_id),
            reader=reader,
            writer=writer,
            traffic=self._messages,
            usage=self._usage,
            password_hash=self._gate.hash_of(session.username),
        )
        await self._serve(client)

    async def _refusal(self, session: Session, address: str) -> int | None:
        """The return code with which a client is refused; None when it may connect."""
        user_name = session.username or ""
        try:
            await self._wrong_passwords.wait(address, user_name)
        except TooManyAttempts:
            self._gate.refused.note()
            return _TRY_LATER
        # Not only at the next poll: a new account may connect now, and a removed one may not.
        self._check_accounts()
        is_right = self._gate.admits(session.username, session.password)
        self._wrong_passwords.note(address, user_name, was_right=is_right)
        if not is_right:
            self._gate.refused.note()
            return _NOT_AUTHORIZED
        has_room = self._has_room(user_name, place_of(user_name, session.client_id))
        return None if has_room and self._usage.may_connect(user_name) else _TRY_LATER

    def _has_room(self, user_name: str, place: str) -> bool:
        """Whether the account may have a client at this place."""
        if place in self._clients or user_name not in SERVICE_ACCOUNTS:
            return True
        others: int = sum(client.user_name == user_name for client in self._clients.values())
        most: int = self._usage.limits_of(user_name).connections
        return others < most

    async def _serve(self, client: Client) -> None:
        self._enter(client)
        has_left = False
        try:
            has_left = await client.serve()
        except (AMQTTError, MQTTError, NoDataError, TimeoutError, OSError) as error:
            reason = str(error) or type(error).__name__
            log.info("client disconnected", extra={"client": client.place, "reason": reason})
        finally:
            self._leave(client, has_left=has_left)

    async def _introduction(self, reader: ClientReader, writer: ClientWriter) -> Session | None:
        """The session of a client's CONNECT; None when there is no valid CONNECT."""
        try:
            async with asyncio.timeout(self._limits.introduction_s):
                return await read_introduction(
                    reader, writer, self.plugins_manager, most_bytes=self._limits.connect_bytes
                )
        except (AMQTTError, MQTTError, NoDataError, TimeoutError, OSError) as error:
            log.info("no valid CONNECT", extra={"reason": str(error)})
            return None

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
        self._messages.drop(client)
        if not has_left and client.session.will_flag:
            self._messages.send_last_will(client)

    async def _poll_accounts(self) -> None:
        for poll in itertools.count():
            await asyncio.sleep(_POLL_S)
            self._check_accounts()
            if poll % _POLLS_PER_LOOK == 0:
                self._put_out_slow_readers()
                self._gate.refused.write()

    def _check_accounts(self) -> None:
        """Disconnect clients whose account is no longer in the password file."""
        if not self._gate.refresh():
            return
        for client in tuple(self._clients.values()):
            # Most hashes are the same as before, and comparing passwords takes long.
            if self._gate.hash_of(client.user_name) == client.password_hash:
                continue
            if not self._gate.admits(client.user_name, client.session.password):
                log.info("account revoked", extra={"client": client.place})
                self._leave(client, has_left=False)
                client.disconnect()

    def _put_out_slow_readers(self) -> None:
        """Disconnect the clients for which most waits, until the rest is within the limit."""
        waiting = [(client.waiting_bytes, client) for client in self._clients.values()]
        total = sum(size for size, _ in waiting)
        for size, client in sorted(waiting, key=lambda each: -each[0]):
            if total <= self._limits.waiting_bytes:
                return
            client.put_out_unread()
            total -= size
