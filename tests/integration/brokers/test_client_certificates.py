"""Mosquitto's TLS listener believes the name in a drone's certificate that is not revoked."""

import asyncio
import getpass
import shutil
import signal
import socket
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from skyway_drone_agent.enrolment.enrolled_drone import ClientCertificate, client_tls

from skyway.broker_setup.account_files import service_files
from skyway.broker_setup.certificates import CertificateAuthority
from skyway.broker_setup.mosquitto import TlsFiles, mosquitto_conf
from skyway.broker_setup.mosquitto_accounts import MosquittoAccounts
from skyway.broker_setup.passwords import hash_password
from skyway.contracts.broker_rules import BrokerRules
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.address import BrokerAddress
from skyway.runtime.mqtt.client import MqttClient
from skyway.runtime.mqtt.connection import Login, MqttConnection, RawMessage

pytestmark = pytest.mark.integration

DRONES = ("p/drone-1", "p/drone-2")
SERVICES = ("gateway", "registry", "composition")


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port


@dataclass
class TlsBroker:
    """Mosquitto with the certificate authority of one deployment."""

    folder: Path
    authority: CertificateAuthority
    port: int = field(default_factory=free_port)
    plain_port: int = field(default_factory=free_port)
    service_port: int = field(default_factory=free_port)
    process: asyncio.subprocess.Process | None = None
    hashes: dict[str, str] = field(
        default_factory=lambda: {name: hash_password(name) for name in DRONES}
    )
    #: The hashes of ended keys, each with the drone's name.
    revoked: dict[str, str] = field(default_factory=dict)

    async def start(self, program: str) -> None:
        files = self._tls_files()
        passwords = self.folder / "passwords"
        service_files(passwords).acl_file.write_text(BrokerRules().service_acl())
        self._write()
        configuration = mosquitto_conf(
            port=self.plain_port,
            service_port=self.service_port,
            password_file=passwords,
            pid_file=self.folder / "pid",
            user=getpass.getuser(),
            tls=files,
        )
        (self.folder / "mosquitto.conf").write_text(configuration)
        self.process = await asyncio.create_subprocess_exec(
            program, "-c", str(self.folder / "mosquitto.conf"), stderr=asyncio.subprocess.DEVNULL
        )

    def _tls_files(self) -> TlsFiles:
        signed = self.authority.sign_broker(["127.0.0.1"])
        files = TlsFiles(
            port=self.port,
            ca_file=self.folder / "ca.pem",
            certificate_file=self.folder / "server.pem",
            key_file=self.folder / "server-key.pem",
        )
        files.ca_file.write_text(self.authority.certificate_pem)
        files.certificate_file.write_text(signed.certificate_pem)
        files.key_file.write_text(signed.private_key_pem)
        return files

    def _write(self) -> None:
        accounts = MosquittoAccounts(self.folder / "passwords", self.authority)
        accounts.write(self.hashes, {name: hash_password(name) for name in SERVICES}, self.revoked)

    async def revoke(self, name: str, *, is_blocked: bool = True) -> None:
        """End a drone's key as the registry does, and perhaps its account, until it is read."""
        self.revoked[f"key of {name}"] = name
        if is_blocked:
            del self.hashes[name]
        self.hashes["p/last"] = hash_password("p/last")
        self._write()
        assert self.process is not None
        login, address = Login("p/last", "p/last", "p/last", 10), self._address(self.plain_port)
        async with asyncio.timeout(60):
            while not await _opens(login, address):
                self.process.send_signal(signal.SIGHUP)

    def _address(self, port: int) -> BrokerAddress:
        return BrokerAddress("127.0.0.1", port, is_encrypted=port == self.port)

    @asynccontextmanager
    async def connected(
        self, name: str, *filters: str, as_drone: str | None = None
    ) -> AsyncIterator[tuple[MqttConnection, list[str]]]:
        """A connection with the topics that it hears; a drone shows the certificate of `as_drone`.

        Its name is a service's, or its password is its name.
        """
        heard: list[str] = []
        link = MqttConnection(
            Login(name, name, name, 10), will=None, on_message=lambda topic, *_: heard.append(topic)
        )
        is_service = name in SERVICES
        tls = None if is_service else self.shown_by(as_drone or name)
        async with asyncio.timeout(60):
            await link.open(self._address(self.service_port if is_service else self.port), tls)
            await link.subscribe(dict.fromkeys(filters, 1))
            try:
                yield link, heard
            finally:
                link.close()

    def shown_by(
        self,
        name: str,
        *,
        signed_by: CertificateAuthority | None = None,
        key_hash: str | None = None,
    ) -> ssl.SSLContext:
        key_hash = key_hash or f"key of {name}"
        signed = (signed_by or self.authority).sign_drone(name, key_hash=key_hash)
        certificate = ClientCertificate(
            certificate_pem=signed.certificate_pem,
            private_key_pem=signed.private_key_pem,
            ca_pem=self.authority.certificate_pem,
        )
        return client_tls(certificate, scratch=self.folder)

    def client(self, name: str) -> MqttClient:
        return MqttClient(
            f"mqtts://127.0.0.1:{self.port}",
            client_id=name,
            user_name=name,
            password=name,
            tls=self.shown_by(name),
        )

    async def is_let_in(self, tls: ssl.SSLContext, *, name: str, password: str) -> bool:
        return await _opens(Login(name, name, password, 10), self._address(self.port), tls)


async def _opens(login: Login, address: BrokerAddress, tls: ssl.SSLContext | None = None) -> bool:
    link = MqttConnection(login, will=None, on_message=lambda *_: None)
    try:
        async with asyncio.timeout(60):
            await link.open(address, tls)
    except (MqttUnavailable, OSError):
        return False
    finally:
        link.close()
    return True


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


async def test_a_certificate_lets_its_drone_in(tls_broker: TlsBroker) -> None:
    tls = tls_broker.shown_by("p/drone-1")

    assert await tls_broker.is_let_in(tls, name="p/drone-1", password="p/drone-1")


async def test_a_password_without_a_certificate_of_the_deployment_is_refused(
    tls_broker: TlsBroker, tmp_path: Path
) -> None:
    shows_nothing = ssl.create_default_context(cadata=tls_broker.authority.certificate_pem)
    other = CertificateAuthority.make(tmp_path / "another deployment")
    from_elsewhere = tls_broker.shown_by("p/drone-1", signed_by=other)

    let_in = [
        await tls_broker.is_let_in(shows_nothing, name="p/drone-1", password="p/drone-1"),
        await tls_broker.is_let_in(from_elsewhere, name="p/drone-1", password="p/drone-1"),
    ]

    assert let_in == [False] * 2


async def test_a_broker_of_another_deployment_is_not_trusted(
    tls_broker: TlsBroker, tmp_path: Path
) -> None:
    other = CertificateAuthority.make(tmp_path / "another deployment")
    trusting = ssl.create_default_context(cadata=other.certificate_pem)
    address = BrokerAddress("127.0.0.1", tls_broker.port, is_encrypted=True)

    with pytest.raises(ssl.SSLCertVerificationError):
        await address.open_socket(trusting)


@pytest.mark.parametrize(
    ("offered", "is_accepted"),
    [
        (["-tls1_3"], True),
        (["-tls1_2", "-cipher", "ECDHE-ECDSA-AES128-GCM-SHA256"], True),
        (["-tls1_2", "-cipher", "ECDHE-ECDSA-CHACHA20-POLY1305"], True),
        (["-tls1_2", "-cipher", "ECDHE-ECDSA-AES128-SHA256"], False),
        (["-tls1_2", "-cipher", "ECDHE-ECDSA-AES256-SHA"], False),
        (["-tls1_1", "-cipher", "DEFAULT@SECLEVEL=0"], False),
    ],
)
async def test_only_current_versions_and_suites_of_tls_are_accepted(
    tls_broker: TlsBroker, offered: list[str], is_accepted: bool
) -> None:
    program = shutil.which("openssl")
    if program is None:
        pytest.skip("openssl is not installed")
    signed = tls_broker.authority.sign_drone("p/drone-1")
    shown = tls_broker.folder / "shown.pem"
    shown.write_text(signed.certificate_pem + signed.private_key_pem)
    where = ["-connect", f"127.0.0.1:{tls_broker.port}", "-cert", str(shown)]

    client = await asyncio.create_subprocess_exec(
        *(program, "s_client", *where, *offered),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    said, _ = await client.communicate()

    assert (b"Cipher is (NONE)" not in said) == is_accepted


def topic(drone: str, kind: str) -> str:
    return f"skyway/v1/{drone}/{kind}"


async def sent(link: MqttConnection, name: str) -> None:
    """Publish, and return once the broker has passed it on to all who may read it."""
    await link.publish(RawMessage(name, b"{}", 1, False))


async def test_a_certificate_with_another_drones_name_and_password_is_its_own_drone(
    tls_broker: TlsBroker,
) -> None:
    """It reads and writes nothing of the other drone, and does not end its connection."""
    first, second = DRONES
    instructions = [topic(drone, "instructions") for drone in DRONES]
    states = [topic(drone, "state") for drone in DRONES]
    async with (
        tls_broker.connected("composition", "skyway/v1/+/+/state") as (service, said),
        tls_broker.connected(first, *instructions) as (other, heard_by_other),
        tls_broker.connected(first, *instructions, as_drone=second) as (thief, heard_by_thief),
    ):
        for name in instructions:
            await sent(service, name)
        for name in states:
            await sent(thief, name)
        await sent(other, topic(first, "state"))

        assert heard_by_thief == [topic(second, "instructions")]
        assert heard_by_other == [topic(first, "instructions")]
        await sent(service, topic(second, "instructions"))
        assert said == [topic(second, "state"), topic(first, "state")]
        assert not other.lost.done()


@pytest.mark.parametrize("is_blocked", [True, False], ids=["blocked", "enrolled again"])
async def test_a_revoked_certificate_is_refused_and_a_later_one_is_not(
    tls_broker: TlsBroker, is_blocked: bool
) -> None:
    stolen = tls_broker.shown_by("p/drone-1")
    assert await tls_broker.is_let_in(stolen, name="p/drone-1", password="p/drone-1")

    await tls_broker.revoke("p/drone-1", is_blocked=is_blocked)
    later = tls_broker.shown_by("p/drone-1", key_hash="the next key")
    other = tls_broker.shown_by("p/drone-2")

    assert not await tls_broker.is_let_in(stolen, name="p/drone-1", password="p/drone-1")
    assert await tls_broker.is_let_in(later, name="p/drone-1", password="p/drone-1")
    assert await tls_broker.is_let_in(other, name="p/drone-2", password="p/drone-2")


async def test_a_revoked_drone_that_is_connected_reads_and_writes_nothing_any_more(
    tls_broker: TlsBroker,
) -> None:
    first, second = DRONES
    own = topic(first, "instructions")
    async with (
        tls_broker.connected("composition", "skyway/v1/+/+/state") as (service, said),
        tls_broker.connected(first, own, "skyway/v1/clock") as (revoked, heard),
        tls_broker.connected(second, "skyway/v1/clock") as (other, _),
    ):
        await sent(service, own)
        await sent(revoked, topic(first, "state"))

        await tls_broker.revoke(first)
        await sent(service, own)
        await sent(revoked, topic(first, "state"))
        await sent(other, topic(second, "state"))
        await sent(service, topic(second, "instructions"))

        assert heard == [own]
        assert said == [topic(first, "state"), topic(second, "state")]
