"""Mosquitto with the certificate authority of one deployment, and drones that show certificates."""

import asyncio
import getpass
import signal
import socket
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

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
from skyway.runtime.mqtt.connection import Login, MqttConnection

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
        """A connection and the topics that it receives; a drone shows that of `as_drone`.

        Its name is a service's, or its password is its name.
        """
        received: list[str] = []
        link = MqttConnection(
            Login(name, name, name, 10),
            will=None,
            on_message=lambda topic, *_: received.append(topic),
        )
        is_service = name in SERVICES
        tls = None if is_service else self.shown_by(as_drone or name)
        async with asyncio.timeout(60):
            await link.open(self._address(self.service_port if is_service else self.port), tls)
            await link.subscribe(dict.fromkeys(filters, 1))
            try:
                yield link, received
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
