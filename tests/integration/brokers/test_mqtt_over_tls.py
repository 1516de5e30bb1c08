"""`mqtts://`: the client speaks TLS to a proxy with a certificate of our own root."""

import asyncio
import shutil
import ssl
import subprocess
from collections.abc import AsyncIterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

from skyway.contracts.topics import CLOCK
from skyway.contracts.world import ClockAnchor
from skyway.runtime.mqtt.address import BrokerAddress
from skyway.runtime.mqtt.client import MqttClient

NOW = datetime(2026, 1, 1, tzinfo=UTC)


@pytest.fixture
def certificate(tmp_path: Path) -> tuple[Path, Path]:
    openssl = shutil.which("openssl")
    if openssl is None:
        pytest.skip("openssl is not installed")
    chain, key = tmp_path / "chain.pem", tmp_path / "key.pem"
    command = ["req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1", "-subj", "/CN=broker"]
    command += ["-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(chain)]
    subprocess.run([openssl, *command], check=True, capture_output=True)
    return chain, key


@pytest.fixture
async def encrypted_port(embedded, certificate) -> AsyncIterator[int]:
    """A TLS port in front of the embedded broker."""
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(*certificate)
    conversations: set[asyncio.Task[None]] = set()

    async def pump(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while data := await reader.read(65536):
            writer.write(data)
        writer.close()

    async def forward_connection(
        reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", embedded.port)
        for pair in ((reader, far_writer), (far_reader, writer)):
            conversations.add(asyncio.create_task(pump(*pair)))

    server = await asyncio.start_server(forward_connection, "127.0.0.1", 0, ssl=context)
    async with server:
        yield server.sockets[0].getsockname()[1]
        server.close()
        for task in conversations:
            task.cancel()
        await asyncio.gather(*conversations, return_exceptions=True)


async def test_messages_travel_over_tls(encrypted_port, certificate, monkeypatch):
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate[0]))
    gateway, drone = (
        MqttClient(
            f"mqtts://127.0.0.1:{encrypted_port}", client_id=name, user_name=name, password=name
        )
        for name in ("gateway", "p/drone-1")
    )
    arrived = drone.batches(CLOCK)

    async with gateway, drone, asyncio.timeout(60):
        await gateway.wait_connected()
        await drone.wait_connected()
        for rate in range(1, 51):
            anchor = ClockAnchor(message_id="m", sent_at=NOW, fleet_at=NOW, wall_at=NOW, rate=rate)
            await gateway.publish(CLOCK(), anchor)
        rates: list[float] = []
        while len(rates) < 50:
            rates += [received.message.rate for received in await anext(arrived)]

    assert rates == list(range(1, 51))


async def test_a_certificate_of_an_unknown_root_is_refused(encrypted_port):
    broker = BrokerAddress("127.0.0.1", encrypted_port, is_encrypted=True)

    with pytest.raises(ssl.SSLCertVerificationError):
        await broker.open_socket()
