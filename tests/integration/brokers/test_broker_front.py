"""HAProxy with deploy/haproxy/broker.cfg before Mosquitto: it limits wrong passwords."""

import asyncio
import os
import shutil
from collections import Counter
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from skyway.errors import SkywayError
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.address import BrokerAddress
from skyway.runtime.mqtt.client import MqttClient
from skyway.runtime.mqtt.connection import Login, MqttConnection
from tests.integration.brokers.tls_broker import DRONES, TlsBroker, free_port

pytestmark = pytest.mark.integration

CONFIGURATION = Path(__file__).parents[3] / "deploy/haproxy/broker.cfg"
FIRST, SECOND = DRONES


class Front:
    """HAProxy before a broker, and how it answers."""

    def __init__(self, broker: TlsBroker) -> None:
        self.broker = broker
        self.port, self.tls_port = free_port(), free_port()
        self.process: asyncio.subprocess.Process | None = None

    async def start(self, program: str) -> None:
        ports = {
            "MQTT_PORT": self.port,
            "MQTT_TLS_PORT": self.tls_port,
            "MQTT_BROKER_PORT": self.broker.plain_port,
            "MQTT_BROKER_TLS_PORT": self.broker.port,
        }
        named = {name: str(port) for name, port in ports.items()}
        self.process = await asyncio.create_subprocess_exec(
            *(program, "-q", "-f", str(CONFIGURATION)),
            env={**os.environ, **named, "MQTT_BROKER": "127.0.0.1"},
        )

    async def answer(self, name: str, password: str) -> str:
        """What a CONNECT is answered, or that the connection was closed without an answer."""
        login = Login(name, name, password, 10)
        link = MqttConnection(login, will=None, on_message=lambda *_: None)
        try:
            async with asyncio.timeout(60):
                await link.open(BrokerAddress("127.0.0.1", self.port, is_encrypted=False))
        except (MqttUnavailable, SkywayError, OSError) as error:
            return "refused by the broker" if "refused by the broker" in str(error) else "closed"
        finally:
            link.close()
        return "accepted"

    async def answer_to(self, said: bytes) -> bytes:
        """All bytes that come after this, until the connection is closed."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        writer.write(said)
        try:
            async with asyncio.timeout(60):
                return await reader.read()
        except ConnectionError:
            return b""
        finally:
            writer.close()


@pytest.fixture
async def front(tls_broker: TlsBroker) -> AsyncIterator[Front]:
    program = shutil.which("haproxy") or shutil.which("haproxy", path="/usr/sbin")
    if program is None:
        pytest.skip("haproxy is not installed")
    opened = Front(tls_broker)
    await opened.start(program)
    assert opened.process is not None
    try:
        url = f"mqtt://127.0.0.1:{opened.port}"
        client = MqttClient(url, client_id=FIRST, user_name=FIRST, password=FIRST)
        async with client, asyncio.timeout(60):
            await client.wait_connected()
        yield opened
    finally:
        opened.process.terminate()
        await opened.process.wait()


async def test_of_many_wrong_passwords_the_broker_sees_ten(front: Front) -> None:
    answers = Counter([await front.answer(FIRST, "wrong") for _ in range(300)])

    assert answers == {"refused by the broker": 10, "closed": 290}


async def test_nobody_else_at_the_address_is_slowed(front: Front) -> None:
    for _ in range(20):
        await front.answer(FIRST, "wrong")

    assert await front.answer(FIRST, FIRST) == "closed"
    assert await front.answer(SECOND, SECOND) == "accepted"


async def test_names_that_nobody_has_are_slowed_as_well(front: Front) -> None:
    answers = Counter([await front.answer("p/nobody", "wrong") for _ in range(30)])

    assert answers == {"refused by the broker": 10, "closed": 20}


async def test_what_is_no_connect_is_closed(front: Front) -> None:
    assert await front.answer_to(b"GET / HTTP/1.1\r\n\r\n") == b""
    assert await front.answer_to(b"\x30\x03\x00\x01a") == b""


async def test_certificates_pass_through_to_mosquitto(front: Front) -> None:
    broker, tls = front.broker, front.broker.shown_by(FIRST)
    broker.port = front.tls_port

    assert await broker.is_let_in(tls, name=FIRST, password=FIRST)
    assert await front.answer(SECOND, SECOND) == "accepted"
