"""Ed25519 keys: 32 bytes, in files and JSON as base64url without padding."""

import base64
import binascii
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from nacl.bindings import (
    crypto_core_ed25519_is_valid_point,
    crypto_sign,
    crypto_sign_BYTES,
    crypto_sign_open,
    crypto_sign_seed_keypair,
)
from nacl.exceptions import BadSignatureError

from skyway.contracts.drones import MOST_NEW_DRONES
from skyway.contracts.signature import head_of, payload_with, signed_bytes, split
from skyway.errors import InvalidInput

_KEY_BYTES: Final = 32


class PrivateKey:
    """A key that signs; `text` is secret."""

    def __init__(self, seed: bytes) -> None:
        self._seed = seed
        self._public, self._secret = crypto_sign_seed_keypair(seed)

    @classmethod
    def new(cls) -> "PrivateKey":
        """A random key."""
        return cls(os.urandom(_KEY_BYTES))

    @classmethod
    def read(cls, text: str) -> "PrivateKey":
        """The key of this text; `InvalidInput` without showing the text."""
        return cls(_bytes_of(text, "signing_key"))

    @property
    def text(self) -> str:
        """The secret, from which the key can be read again."""
        return _text_of(self._seed)

    @property
    def public_key(self) -> str:
        """The public key."""
        return _text_of(self._public)

    def signed(self, topic_name: str, payload: bytes) -> bytes:
        """The JSON object with its signature for this topic as the last member."""
        head = head_of(payload)
        signature = crypto_sign(signed_bytes(topic_name, head), self._secret)[:crypto_sign_BYTES]
        return payload_with(head, signature)


def public_key_bytes(text: str) -> bytes:
    """The bytes of a public key.

    Raises
    ------
    InvalidInput
        The text is not 32 bytes in base64url, or the bytes are not a valid public key.
    """
    key = _bytes_of(text, "public_key")
    if not crypto_core_ed25519_is_valid_point(key):
        raise InvalidInput("public_key", "is no Ed25519 public key")
    return key


def is_signed_by(key: bytes, topic_name: str, payload: bytes) -> bool:
    """Whether the payload was signed with this public key, for this topic."""
    parts = split(payload)
    if parts is None:
        return False
    try:
        crypto_sign_open(parts.signature + signed_bytes(topic_name, parts.head), key)
    except BadSignatureError:
        return False
    return True


def _text_of(key: bytes) -> str:
    return base64.urlsafe_b64encode(key).rstrip(b"=").decode()


def _bytes_of(text: str, field: str) -> bytes:
    try:
        key = base64.b64decode(text.encode() + b"=", altchars=b"-_", validate=True)
    except (binascii.Error, ValueError):
        key = b""
    if len(key) != _KEY_BYTES:
        raise InvalidInput(field, "is not 32 bytes in base64url without padding")
    return key


class FleetKeys:
    """A key pair for each drone: public keys go to the registry, private keys into the fleet file.

    The values of JSON objects are Any.
    """

    def __init__(self, drones: Sequence[Mapping[str, Any]]) -> None:
        self._drones = drones
        self._keys = [PrivateKey.new() for _ in drones]

    @property
    def bodies(self) -> list[dict[str, Any]]:
        """The drones as they are registered, each with its public key."""
        pairs = zip(self._drones, self._keys, strict=True)
        return [{**drone, "public_key": key.public_key} for drone, key in pairs]

    def batches(self) -> Iterator[list[dict[str, Any]]]:
        """The same in as many lists as calls are needed to register them."""
        for first in range(0, len(self._drones), MOST_NEW_DRONES):
            yield self.bodies[first : first + MOST_NEW_DRONES]

    def kept(self, registered: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """The answer to the registration, in its order, each drone with its private key."""
        pairs = zip(registered, self._keys, strict=True)
        return [{**drone, "signing_key": key.text} for drone, key in pairs]
