"""A deployment's own certificate authority: it signs only its broker and its drones.

Mosquitto believes the name in a drone's certificate. Certificates whose credentials have ended are
on a list that the authority signs.
"""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import Final, Self

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from skyway.broker_setup.private_file import write_private
from skyway.runtime.errors import InvalidSettings

_AUTHORITY_LIFE: Final = timedelta(days=3650)
#: A drone gets another one with each rotation of its credentials.
CLIENT_LIFE: Final = timedelta(days=730)
#: Clocks of drones may be behind.
_BACKDATED: Final = timedelta(days=1)

_SIGNS_CERTIFICATES: Final = x509.KeyUsage(
    digital_signature=False,
    content_commitment=False,
    key_encipherment=False,
    data_encipherment=False,
    key_agreement=False,
    key_cert_sign=True,
    crl_sign=True,
    encipher_only=False,
    decipher_only=False,
)

_CERTIFICATE: Final = "ca.pem"
_KEY: Final = "ca-key.pem"


@dataclass(frozen=True, slots=True)
class SignedKey:
    """A private key and its certificate, both as PEM."""

    certificate_pem: str
    private_key_pem: str


class CertificateAuthority:
    """Signs with the key in its folder, which only this user can read."""

    def __init__(self, certificate: x509.Certificate, key: ec.EllipticCurvePrivateKey) -> None:
        self._certificate = certificate
        self._key = key

    @classmethod
    def load(cls, folder: Path) -> Self:
        """The authority that was made in this folder.

        Raises
        ------
        InvalidSettings
            There is none.
        """
        try:
            certificate = x509.load_pem_x509_certificate((folder / _CERTIFICATE).read_bytes())
            key = load_pem_private_key((folder / _KEY).read_bytes(), password=None)
        except (OSError, ValueError) as error:
            raise InvalidSettings(f"{folder} holds no certificate authority") from error
        if not isinstance(key, ec.EllipticCurvePrivateKey):
            raise InvalidSettings(f"{folder} holds a certificate authority of another kind")
        return cls(certificate, key)

    @classmethod
    def make(cls, folder: Path, name: str = "Skyway deployment") -> Self:
        """The authority in this folder; a new one under this name if it has none yet."""
        if not (folder / _CERTIFICATE).exists():
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            key, subject = ec.generate_private_key(ec.SECP256R1()), _name(name)
            builder = _builder(subject, key.public_key(), issuer=subject, life=_AUTHORITY_LIFE)
            builder = builder.add_extension(x509.BasicConstraints(True, 0), critical=True)
            builder = builder.add_extension(_SIGNS_CERTIFICATES, critical=True)
            builder = builder.serial_number(x509.random_serial_number())
            signed = _signed(builder, key, by=key)
            # The certificate is written last: its presence means that both files exist.
            write_private(folder / _KEY, signed.private_key_pem)
            write_private(folder / _CERTIFICATE, signed.certificate_pem)
        return cls.load(folder)

    @property
    def certificate_pem(self) -> str:
        """The certificate by which all certificates of this deployment are checked."""
        return self._certificate.public_bytes(Encoding.PEM).decode()

    def sign_drone(self, account: str, *, key_hash: str | None = None) -> SignedKey:
        """A new key for a drone with this account, valid only for connecting as a client.

        `key_hash` is that of the drone's key for REST: the certificate ends with it.
        """
        serial = None if key_hash is None else _serial(key_hash)
        usages = [ExtendedKeyUsageOID.CLIENT_AUTH]
        return self._sign(account, usages, (), life=CLIENT_LIFE, serial=serial)

    def revoked_pem(self, key_hashes: Iterable[str] = ()) -> str:
        """The signed list of the certificates that came with these keys; it is valid for ten years.

        Who reads it must not be locked out by its end: the registry replaces it when it changes.
        """
        now = datetime.now(UTC)
        builder = (
            x509.CertificateRevocationListBuilder()
            .issuer_name(self._certificate.subject)
            .last_update(now - _BACKDATED)
            .next_update(now + _AUTHORITY_LIFE)
        )
        for key_hash in sorted(key_hashes):
            revoked = x509.RevokedCertificateBuilder().serial_number(_serial(key_hash))
            builder = builder.add_revoked_certificate(revoked.revocation_date(now).build())
        return builder.sign(self._key, hashes.SHA256()).public_bytes(Encoding.PEM).decode()

    def sign_broker(self, names: Iterable[str]) -> SignedKey:
        """A new key for a broker under these host names and addresses."""
        host_names = tuple(names)
        usage = ExtendedKeyUsageOID.SERVER_AUTH
        return self._sign(host_names[0], [usage], host_names, life=_AUTHORITY_LIFE)

    def sign_node(self, names: Iterable[str]) -> SignedKey:
        """A new key for a node of a broker's cluster, which is server and client of the others.

        The authority must sign nodes only: each of its certificates lets into the cluster.
        """
        host_names = tuple(names)
        usages = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
        return self._sign(host_names[0], usages, host_names, life=_AUTHORITY_LIFE)

    def _sign(
        self,
        subject: str,
        usages: list[x509.ObjectIdentifier],
        names: Iterable[str],
        *,
        life: timedelta,
        serial: int | None = None,
    ) -> SignedKey:
        key = ec.generate_private_key(ec.SECP256R1())
        builder = _builder(
            _name(subject), key.public_key(), issuer=self._certificate.subject, life=life
        ).serial_number(serial or x509.random_serial_number())
        builder = builder.add_extension(x509.BasicConstraints(False, None), critical=True)
        authority = x509.AuthorityKeyIdentifier.from_issuer_public_key(self._key.public_key())
        builder = builder.add_extension(authority, critical=False)
        builder = builder.add_extension(x509.ExtendedKeyUsage(usages), critical=False)
        alternatives = [_alternative(name) for name in names]
        if alternatives:
            builder = builder.add_extension(
                x509.SubjectAlternativeName(alternatives), critical=False
            )
        return _signed(builder, key, by=self._key)


def _serial(key_hash: str) -> int:
    """The serial number of the certificate that came with a key: 159 bits, so nothing is stored."""
    return int.from_bytes(hashlib.sha256(f"certificate {key_hash}".encode()).digest()[:20]) >> 1


def _name(text: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])


def _alternative(name: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ip_address(name))
    except ValueError:
        return x509.DNSName(name)


def _builder(
    subject: x509.Name, key: ec.EllipticCurvePublicKey, *, issuer: x509.Name, life: timedelta
) -> x509.CertificateBuilder:
    now = datetime.now(UTC)
    return (
        x509.CertificateBuilder()
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key), critical=False)
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key)
        .not_valid_before(now - _BACKDATED)
        .not_valid_after(now + life)
    )


def _signed(
    builder: x509.CertificateBuilder,
    key: ec.EllipticCurvePrivateKey,
    *,
    by: ec.EllipticCurvePrivateKey,
) -> SignedKey:
    private = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    certificate = builder.sign(by, hashes.SHA256()).public_bytes(Encoding.PEM)
    return SignedKey(certificate.decode(), private.decode())
