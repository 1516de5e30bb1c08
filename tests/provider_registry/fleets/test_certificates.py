"""With an authority, a drone's credentials hold a certificate that this authority signed."""

import hashlib
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID
from skyway_provider_registry.fleets.issue_credentials import Credentials, Issuer

from skyway.broker_setup.certificates import CertificateAuthority
from skyway.broker_setup.mosquitto_accounts import MosquittoAccounts
from skyway.broker_setup.passwords import hash_password
from skyway.ids import DroneId, ProviderId
from skyway.runtime.errors import InvalidSettings
from skyway.runtime.signing.cloud_key_file import CLOUD_KEYS, CloudKeyFile
from tests.signing_files import write_cloud_keys

PROVIDER, DRONE = ProviderId("prv_1"), DroneId("drn_1")


def cloud_keys(folder: Path) -> CloudKeyFile:
    write_cloud_keys(folder)
    return CloudKeyFile(folder / CLOUD_KEYS)


def test_a_drones_certificate_names_it_and_is_signed_for_clients(tmp_path: Path) -> None:
    authority = CertificateAuthority.make(tmp_path / "ca")

    made = Issuer(authority, cloud_keys(tmp_path), hash_password).make(PROVIDER, DRONE).certificate

    assert made is not None
    certificate = x509.load_pem_x509_certificate(made.certificate_pem.encode())
    certificate.verify_directly_issued_by(x509.load_pem_x509_certificate(made.ca_pem.encode()))
    [name] = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    usage = certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    key = load_pem_private_key(made.private_key_pem.encode(), password=None)
    # Mosquitto believes this name: it is the user name of the drone's account.
    assert name.value == "prv_1/drn_1"
    assert list(usage) == [ExtendedKeyUsageOID.CLIENT_AUTH]
    assert key.public_key() == certificate.public_key()


def test_credentials_are_unique_and_hidden_in_representations(tmp_path: Path) -> None:
    issuer = Issuer(CertificateAuthority.make(tmp_path / "ca"), cloud_keys(tmp_path), hash_password)

    one, other = issuer.make(PROVIDER, DRONE), issuer.make(PROVIDER, DRONE)

    assert one.key != other.key
    assert one.mqtt.password != other.mqtt.password
    assert one.certificate is not None
    assert one.certificate != other.certificate
    for secret in (one.key, one.mqtt.password, one.certificate.private_key_pem):
        assert secret not in repr(one)


def test_without_an_authority_there_is_no_certificate(tmp_path: Path) -> None:
    assert (
        Issuer(None, cloud_keys(tmp_path), hash_password).make(PROVIDER, DRONE).certificate is None
    )


def test_an_authority_is_made_once_and_only_this_user_can_read_it(tmp_path: Path) -> None:
    first = CertificateAuthority.make(tmp_path / "ca")
    again = CertificateAuthority.make(tmp_path / "ca")

    assert first.certificate_pem == again.certificate_pem
    modes = {path.name: path.stat().st_mode & 0o777 for path in (tmp_path / "ca").iterdir()}
    assert modes == {"ca.pem": 0o600, "ca-key.pem": 0o600}


@pytest.mark.parametrize("damage", ["nothing there", "not a key"])
def test_a_folder_without_an_authority_is_named(tmp_path: Path, damage: str) -> None:
    if damage == "not a key":
        CertificateAuthority.make(tmp_path)
        (tmp_path / "ca-key.pem").write_text("not a key")

    with pytest.raises(InvalidSettings, match="certificate authority"):
        CertificateAuthority.load(tmp_path)


def test_the_list_names_the_certificates_that_came_with_ended_keys(tmp_path: Path) -> None:
    authority = CertificateAuthority.make(tmp_path / "ca")
    issuer = Issuer(authority, cloud_keys(tmp_path), hash_password)
    ended, valid = issuer.make(PROVIDER, DRONE), issuer.make(PROVIDER, DRONE)
    key_hash = hashlib.sha256(ended.key.encode()).hexdigest()
    accounts = MosquittoAccounts(tmp_path / "passwords", authority)

    accounts.write({"prv_1/drn_1": hash_password("x")}, {}, {key_hash: "prv_1/drn_2"})

    revoked = x509.load_pem_x509_crl((tmp_path / "revoked.pem").read_bytes())
    certificate = x509.load_pem_x509_certificate(authority.certificate_pem.encode())
    public_key = certificate.public_key()
    assert isinstance(public_key, ec.EllipticCurvePublicKey)
    assert revoked.is_signature_valid(public_key)
    is_listed = {
        name: revoked.get_revoked_certificate_by_serial_number(serial_of(made)) is not None
        for name, made in (("ended", ended), ("valid", valid))
    }
    assert is_listed == {"ended": True, "valid": False}
    rights = (tmp_path / "client_acl").read_text()
    assert "user prv_1/drn_2\ntopic deny #\n" in rights
    assert "user prv_1/drn_1" not in rights


def serial_of(made: Credentials) -> int:
    assert made.certificate is not None
    return x509.load_pem_x509_certificate(made.certificate.certificate_pem.encode()).serial_number
