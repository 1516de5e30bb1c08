"""Mosquitto's TLS listener believes the name in a drone's certificate that is not revoked."""

import asyncio
import shutil
import ssl
from pathlib import Path

import pytest
from skyway_provider_registry.parts import take_over
from skyway_provider_registry.settings import RegistrySettings

from skyway.broker_setup.certificates import CertificateAuthority
from skyway.runtime.mqtt.address import BrokerAddress
from skyway.runtime.mqtt.connection import MqttConnection, RawMessage
from tests.integration.brokers.tls_broker import DRONES, TlsBroker

pytestmark = pytest.mark.integration


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
        tls_broker.connected(first, *instructions) as (other, received_by_other),
        tls_broker.connected(first, *instructions, as_drone=second) as (thief, received_by_thief),
    ):
        for name in instructions:
            await sent(service, name)
        for name in states:
            await sent(thief, name)
        await sent(other, topic(first, "state"))

        assert received_by_thief == [topic(second, "instructions")]
        assert received_by_other == [topic(first, "instructions")]
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
        tls_broker.connected(first, own, "skyway/v1/clock") as (revoked, received),
        tls_broker.connected(second, "skyway/v1/clock") as (other, _),
    ):
        await sent(service, own)
        await sent(revoked, topic(first, "state"))

        await tls_broker.revoke(first)
        await sent(service, own)
        await sent(revoked, topic(first, "state"))
        await sent(other, topic(second, "state"))
        await sent(service, topic(second, "instructions"))

        assert received == [own]
        assert said == [topic(first, "state"), topic(second, "state")]


async def test_the_registry_ends_the_connection_of_a_revoked_drone(tls_broker: TlsBroker) -> None:
    (tls_broker.folder / "mqtt_registry").write_text("registry\n")
    settings = RegistrySettings(
        database_url="sqlite:///none.db",
        mqtt_url=f"mqtt://127.0.0.1:{tls_broker.service_port}",
        secrets_dir=tls_broker.folder,
        broker_password_file=tls_broker.folder / "passwords",
    )
    first, second = DRONES
    async with (
        tls_broker.connected(first, "skyway/v1/clock") as (revoked, _),
        tls_broker.connected(second, "skyway/v1/clock") as (other, _),
    ):
        await tls_broker.revoke(first)

        await take_over(settings, first)

        async with asyncio.timeout(60):
            await revoked.lost
        assert not other.lost.done()
        shown = tls_broker.shown_by(first)
        assert not await tls_broker.is_let_in(shown, name=first, password=first)
