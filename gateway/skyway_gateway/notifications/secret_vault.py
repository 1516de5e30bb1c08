"""Encrypts the signing secrets of webhooks: the database holds no secret that can be read.

The keys are in the file `webhook_keys` of the secrets folder, one a line, each the base64 of 32
bytes. The first key encrypts; the others still decrypt. A stored secret is
``v1.<id of the key>.<base64 of nonce and AES-GCM ciphertext>``. The id of its webhook is part of
what is authenticated, so a secret that is copied to the row of another webhook cannot be decrypted.
"""

import base64
import hashlib
import re
import secrets
from functools import cached_property
from pathlib import Path
from typing import Final

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESGCM

from skyway.errors import SkywayError
from skyway.ids import WebhookId
from skyway.runtime.errors import InvalidSettings
from skyway.runtime.peer_secrets import read_secret

KEYS_FILE: Final = "webhook_keys"

_KEY_BYTES: Final = 32
_NONCE_BYTES: Final = 12
_TAG_BYTES: Final = 16
_FORM: Final = re.compile(r"v1\.([0-9a-f]{8})\.([A-Za-z0-9_=-]+)")


class UnreadableSecret(SkywayError):
    """A stored secret was encrypted with a key that the file does not hold, or was changed."""


class SecretVault:
    """Encrypts and decrypts; the file of keys is read at the first use."""

    def __init__(self, secrets_dir: Path) -> None:
        self._secrets_dir = secrets_dir

    @cached_property
    def _boxes(self) -> dict[str, AESGCM]:
        """By id: the keys, the one that encrypts first."""
        lines = read_secret(self._secrets_dir, KEYS_FILE).split()
        keys = [_key(line, number) for number, line in enumerate(lines, start=1)]
        return {_id_of(key): AESGCM(key) for key in keys}

    def require_keys(self) -> None:
        """Read the file now, so that a process without it ends at its start.

        Raises
        ------
        InvalidSettings
            The file is missing, or holds something else than keys.
        """
        self._boxes  # noqa: B018

    @property
    def prefix(self) -> str:
        """How each text begins that the first key has encrypted."""
        return f"v1.{next(iter(self._boxes))}."

    def seal(self, secret: str, webhook_id: WebhookId) -> str:
        """The secret of a webhook, encrypted with the first key."""
        nonce = secrets.token_bytes(_NONCE_BYTES)
        box = next(iter(self._boxes.values()))
        sealed = nonce + box.encrypt(nonce, secret.encode(), webhook_id.encode())
        return self.prefix + base64.urlsafe_b64encode(sealed).decode()

    def open(self, stored: str, webhook_id: WebhookId) -> str:
        """The secret of a webhook.

        Raises
        ------
        UnreadableSecret
            No key of the file decrypts it.
        """
        found = _FORM.fullmatch(stored)
        if found is None:
            raise UnreadableSecret("it is not a secret")
        box = self._boxes.get(found[1])
        if box is None:
            raise UnreadableSecret(f"{KEYS_FILE} does not hold the key {found[1]}")
        try:
            sealed = base64.urlsafe_b64decode(found[2])
            nonce, ciphertext = sealed[:_NONCE_BYTES], sealed[_NONCE_BYTES:]
            return box.decrypt(nonce, ciphertext, webhook_id.encode()).decode()
        except (InvalidTag, ValueError) as error:
            raise UnreadableSecret("it was changed, or belongs to another webhook") from error


def read_stored_secret(stored: str) -> str:
    """The text of a stored secret, whose form is whole; nobody can read it without its key.

    Raises
    ------
    ValueError
        It is not encrypted.
    """
    found = _FORM.fullmatch(stored)
    if found is None or len(base64.urlsafe_b64decode(found[2])) <= _NONCE_BYTES + _TAG_BYTES:
        raise ValueError("not a whole encrypted secret")
    return stored


def _key(line: str, number: int) -> bytes:
    # Both alphabets of base64 are in use.
    try:
        key = base64.b64decode(line.translate(str.maketrans("-_", "+/")), validate=True)
    except ValueError:
        key = b""
    if len(key) != _KEY_BYTES:
        raise InvalidSettings(
            f"line {number} of the file {KEYS_FILE} in SKYWAY_SECRETS_DIR is not the base64 of "
            f"{_KEY_BYTES} bytes"
        )
    return key


def _id_of(key: bytes) -> str:
    return hashlib.sha256(b"skyway webhook key " + key).hexdigest()[:8]
