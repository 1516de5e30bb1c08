"""A drone's key: how it is made, and what is stored of it."""

import hashlib
import secrets
from typing import Final

from skyway.contracts.drone_key import DRONE_KEY_PREFIX

#: 256 bits: nobody guesses them, so that a fast hash is enough.
_SECRET_BYTES: Final = 32


def new_key() -> str:
    """A new key of a drone."""
    return DRONE_KEY_PREFIX + secrets.token_urlsafe(_SECRET_BYTES)


def key_hash(key: str) -> str:
    """What is stored of a key; the gateway asks by the same hash."""
    return hashlib.sha256(key.encode()).hexdigest()
