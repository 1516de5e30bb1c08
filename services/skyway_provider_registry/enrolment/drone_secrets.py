"""The secrets of drones: how they are made, and the hashes that are stored of them."""

import hashlib
import secrets
from collections.abc import Iterable
from datetime import timedelta
from typing import Final

from skyway.broker_setup.passwords import hash_password
from skyway.contracts.drone_key import DRONE_KEY_PREFIX
from skyway.ids import DroneId

_PREFIX: Final = "enr_"
#: 256 bits: nobody guesses such a secret, so a fast hash is safe enough.
_SECRET_BYTES: Final = 32

#: How long an enrolment token can be exchanged, wall time.
TOKEN_LIFE: Final = timedelta(days=30)


def new_password() -> str:
    """A random broker password."""
    return secrets.token_urlsafe(_SECRET_BYTES)


def new_passwords(drone_ids: Iterable[DroneId]) -> tuple[dict[DroneId, str], dict[DroneId, str]]:
    """A random broker password for each drone, and its hash; 5,000 of them take 0.3 s."""
    passwords = {drone_id: new_password() for drone_id in drone_ids}
    return passwords, {drone: hash_password(password) for drone, password in passwords.items()}


def new_key() -> str:
    """A new key, which the drone shows when it calls REST."""
    return DRONE_KEY_PREFIX + secrets.token_urlsafe(_SECRET_BYTES)


def key_hash(key: str) -> str:
    """The hash that is stored of a key; the gateway asks with the same hash."""
    return hashlib.sha256(key.encode()).hexdigest()


def new_token() -> str:
    """A new enrolment token."""
    return _PREFIX + secrets.token_urlsafe(_SECRET_BYTES)


def token_hash(token: str) -> str:
    """The hash that is stored of a token, and by which a shown token is looked up."""
    return hashlib.sha256(token.encode()).hexdigest()
