"""Both brokers behind one interface, their clients, and a proxy that can cut connections."""

import asyncio
import contextlib
import getpass
import shutil
import signal
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Protocol

import pytest
from skyway_broker.gate import Gate
from skyway_broker.hardened import HardenedBroker
from skyway_broker.limits import Limits

from skyway.broker_setup.account_files import client_files, service_files
from skyway.broker_setup.certificates import CertificateAuthority
from skyway.broker_setup.mosquitto import mosquitto_conf
from skyway.broker_setup.passwords import hash_password, write_password_file
from skyway.contracts.broker_rules import BrokerRules, is_operator
from skyway.contracts.delivery_event import DeliveryEvent, DeliveryEventType
from skyway.contracts.drone_report import Ack, Connection
from skyway.contracts.instruction import ReportInstruction
from skyway.contracts.world import ClockAnchor, StationState
from skyway.runtime.mqtt.client import MqttClient, Received
from tests.integration.brokers.nats_alone import NatsAlone
from tests.integration.brokers.tls_broker import TlsBroker, free_port

SERVICES = ("gateway", "registry", "composition")
NOW = datetime(2026, 1, 1, tzinfo=UTC)
CLIENTS = (
    "operator/olga",
    "p/drone-1",
    "p/drone-2",
    "customer-1",
    "customer-2",
    "drone-1",
    "station-1",
)


class RunningBroker(Protocol):
    """A broker that can be stopped, started again on the same ports, and given accounts."""

    port: int
    service_port: int
    sends_will_of_replaced: bool

    async def start(self) -> None: ...

    async def stop(self) -> None: ...

    async def set_accounts(self, names: tuple[str, ...]) -> None: ...


class EmbeddedBroker:
    sends_will_of_replaced = True

    def __init__(self, folder: Path, limits: Limits | None = None) -> None:
        self.port = self.service_port = free_port()
        self._limits = limits
        self._passwords = folder / "passwords"
        self._broker: HardenedBroker | None = None

    async def start(self) -> None:
        listener = socket.create_server(("127.0.0.1", self.port))
        gate = Gate(self._passwords)
        self._broker = HardenedBroker(listener, gate=gate, rules=BrokerRules(), limits=self._limits)
        await self._broker.start()

    async def stop(self) -> None:
        if self._broker is not None:
            await self._broker.shutdown()
            self._broker = None

    async def set_accounts(self, names: tuple[str, ...]) -> None:
        write_accounts(self._passwords, {name: hash_password(name) for name in names})


class Mosquitto:
    sends_will_of_replaced = True

    def __init__(self, folder: Path, program: str) -> None:
        self.port, self.service_port = free_port(), free_port()
        self._folder = folder
        self._program = program
        self._passwords = folder / "passwords"
        self._hashes: dict[str, str] = {}
        self._process: asyncio.subprocess.Process | None = None
        (folder / "mosquitto.conf").write_text(
            mosquitto_conf(
                port=self.port,
                service_port=self.service_port,
                password_file=self._passwords,
                pid_file=folder / "pid",
                user=getpass.getuser(),
            )
        )

    async def start(self) -> None:
        self._process = await asyncio.create_subprocess_exec(
            self._program,
            "-c",
            str(self._folder / "mosquitto.conf"),
            stderr=asyncio.subprocess.DEVNULL,
        )
        # Before it listens, a signal to read its accounts again would end it.
        async with asyncio.timeout(60):
            while not await self._listens():
                assert self._process.returncode is None

    async def _listens(self) -> bool:
        try:
            _, writer = await asyncio.open_connection("127.0.0.1", self.service_port)
        except OSError:
            return False
        writer.close()
        await writer.wait_closed()
        return True

    @property
    def memory_bytes(self) -> int:
        """What the process holds of the machine's memory."""
        assert self._process is not None
        status = Path(f"/proc/{self._process.pid}/status").read_text().splitlines()
        [held] = [line for line in status if line.startswith("VmRSS:")]
        return int(held.split()[1]) * 1024

    async def stop(self) -> None:
        if self._process is not None:
            self._process.terminate()
            await self._process.wait()
            self._process = None

    async def set_accounts(self, names: tuple[str, ...]) -> None:
        # A new hash of an existing account is a new password, which disconnects its client.
        self._hashes = {name: self._hashes.get(name) or hash_password(name) for name in names}
        write_accounts(self._passwords, self._hashes)
        if self._process is not None:
            self._process.send_signal(signal.SIGHUP)


def write_accounts(passwords: Path, hashes: dict[str, str]) -> None:
    """The files of all accounts, as the registry writes them."""
    clients, services, rules = client_files(passwords), service_files(passwords), BrokerRules()
    clients.acl_file.write_text(rules.client_acl(filter(is_operator, hashes)))
    services.acl_file.write_text(rules.service_acl())
    for file, belongs in ((services.password_file, True), (clients.password_file, False)):
        write_password_file(
            file,
            {name: each for name, each in hashes.items() if (name in SERVICES) == belongs},
        )


class BrokerProxy:
    """A proxy to a broker that can break connections, or go silent without closing them."""

    def __init__(self, port: int) -> None:
        self._to = port
        self._server: asyncio.Server | None = None
        self._writers: list[asyncio.StreamWriter] = []
        self._pumps: list[asyncio.Task[None]] = []
        self._is_silent = False
        self._may_pass = asyncio.Event()
        self._may_pass.set()
        self.port = 0

    async def __aenter__(self) -> "BrokerProxy":
        self._server = await asyncio.start_server(self._forward_connection, "127.0.0.1", 0)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_: object) -> None:
        assert self._server is not None
        self._server.close()
        self.cut()
        for pump in self._pumps:
            pump.cancel()
        await asyncio.gather(*self._pumps, return_exceptions=True)

    def cut(self) -> None:
        for writer in self._writers:
            writer.transport.abort()

    def go_silent(self) -> None:
        self._is_silent = True

    def pause(self) -> None:
        """Pass nothing on from now on, and lose nothing."""
        self._may_pass.clear()

    def resume(self) -> None:
        """Pass on again, also what has waited."""
        self._may_pass.set()

    async def _forward_connection(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self._to)
        self._writers += [writer, far_writer]
        self._pumps += [
            asyncio.create_task(self._pump(reader, far_writer)),
            asyncio.create_task(self._pump(far_reader, writer)),
        ]

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError):
            while data := await reader.read(65536):
                await self._may_pass.wait()
                if not self._is_silent:
                    writer.write(data)
        # A silent proxy forwards nothing, not even the end of a connection.
        if not self._is_silent:
            writer.transport.abort()


@pytest.fixture(name="free_port")
def find_free_port() -> Callable[[], int]:
    return free_port


def make_connection(number: int, status: str = "ONLINE") -> Connection:
    return Connection(
        message_id="m",
        sent_at=NOW,
        session=1,
        connection_number=number,
        status=status,
    )


def make_ack(seq: int) -> Ack:
    return Ack(
        message_id="m",
        sent_at=NOW,
        session=1,
        seq=seq,
        instruction_id="i",
        instruction_seq=seq,
        stream=1,
        status="RECEIVED",
    )


def make_instruction(seq: int) -> ReportInstruction:
    return ReportInstruction(
        message_id="m",
        sent_at=NOW,
        instruction_id=f"i{seq}",
        stream=1,
        seq=seq,
        expires_at=NOW + timedelta(minutes=1),
        events_after_seq=0,
    )


def make_event(delivery_id: str) -> DeliveryEvent:
    return DeliveryEvent(
        message_id="m",
        sent_at=NOW,
        event_id="e",
        type=DeliveryEventType.REQUESTED,
        delivery_id=delivery_id,
        sequence=1,
        occurred_at=NOW,
    )


def make_anchor(rate: float) -> ClockAnchor:
    return ClockAnchor(message_id="m", sent_at=NOW, fleet_at=NOW, wall_at=NOW, rate=rate)


def make_station_state(pads_taken: int) -> StationState:
    return StationState(message_id="m", sent_at=NOW, station_id="s", pads=2, pads_taken=pads_taken)


async def receive_exactly(
    batches: AsyncIterator[list[Received[Any]]], count: int
) -> list[Received[Any]]:
    """The next messages, in order; fails when there are more or fewer."""
    received: list[Received[Any]] = []
    async with asyncio.timeout(60):
        while len(received) < count:
            received += await anext(batches)
    assert len(received) == count
    return received


async def wait_all_connected(*clients: Any) -> None:
    async with asyncio.timeout(60):
        for client in clients:
            await client.wait_connected()


async def wait_until(holds: Callable[[], bool]) -> None:
    async with asyncio.timeout(60):
        while not holds():  # noqa: ASYNC110 - the client has no event for every condition
            await asyncio.sleep(0.001)


@pytest.fixture
def make() -> SimpleNamespace:
    """What the tests send: make.ack, make.connection, and so on."""
    return SimpleNamespace(
        connection=make_connection,
        ack=make_ack,
        instruction=make_instruction,
        event=make_event,
        anchor=make_anchor,
        station_state=make_station_state,
    )


@pytest.fixture
def receive() -> Callable[..., Awaitable[list[Received[Any]]]]:
    return receive_exactly


@pytest.fixture
def all_connected() -> Callable[..., Awaitable[None]]:
    return wait_all_connected


@pytest.fixture
def until() -> Callable[[Callable[[], bool]], Awaitable[None]]:
    return wait_until


@pytest.fixture
async def embedded(tmp_path: Path) -> AsyncIterator[RunningBroker]:
    broker = EmbeddedBroker(tmp_path)
    await broker.set_accounts((*SERVICES, *CLIENTS))
    await broker.start()
    yield broker
    await broker.stop()


@pytest.fixture
async def limited(
    tmp_path: Path,
) -> AsyncIterator[Callable[[Limits], Awaitable[RunningBroker]]]:
    """Start an embedded broker with limits of its own."""
    started: list[EmbeddedBroker] = []

    async def start(limits: Limits) -> RunningBroker:
        broker = EmbeddedBroker(tmp_path, limits)
        started.append(broker)
        await broker.set_accounts((*SERVICES, *CLIENTS))
        await broker.start()
        return broker

    yield start
    for broker in started:
        await broker.stop()


def mosquitto_program() -> str:
    program = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
    if program is None:
        pytest.skip("mosquitto is not installed")
    return program


@pytest.fixture
async def mosquitto(tmp_path: Path) -> AsyncIterator[Mosquitto]:
    running = Mosquitto(tmp_path, mosquitto_program())
    await running.set_accounts((*SERVICES, *CLIENTS))
    await running.start()
    yield running
    await running.stop()


@pytest.fixture(params=["embedded", "mosquitto", "nats"])
async def broker(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[RunningBroker]:
    running: RunningBroker
    if request.param == "embedded":
        running = EmbeddedBroker(tmp_path)
    elif request.param == "nats":
        running = NatsAlone(tmp_path, port=free_port())
    else:
        running = Mosquitto(tmp_path, mosquitto_program())
    await running.set_accounts((*SERVICES, *CLIENTS))
    await running.start()
    yield running
    await running.stop()


Connect = Callable[..., Awaitable[MqttClient]]


@pytest.fixture
async def connect() -> AsyncIterator[Connect]:
    """Make a client of an account whose password is its name, and enter it."""
    async with contextlib.AsyncExitStack() as stack:

        async def enter(port: int, user_name: str, **more: Any) -> MqttClient:
            names = {"client_id": user_name, "user_name": user_name, "password": user_name}
            client = MqttClient(f"mqtt://127.0.0.1:{port}", **(names | more))
            return await stack.enter_async_context(client)

        yield enter


@pytest.fixture
async def broker_proxy() -> AsyncIterator[Callable[[int], Awaitable[BrokerProxy]]]:
    async with contextlib.AsyncExitStack() as stack:

        async def open_proxy(port: int) -> BrokerProxy:
            return await stack.enter_async_context(BrokerProxy(port))

        yield open_proxy


@pytest.fixture
async def tls_broker(tmp_path: Path) -> AsyncIterator[TlsBroker]:
    program = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
    if program is None:
        pytest.skip("mosquitto is not installed")
    broker = TlsBroker(tmp_path, CertificateAuthority.make(tmp_path / "ca"))
    await broker.start(program)
    assert broker.process is not None
    try:
        async with broker.client("p/drone-2") as first, asyncio.timeout(60):
            await first.wait_connected()
        yield broker
    finally:
        broker.process.terminate()
        await broker.process.wait()
