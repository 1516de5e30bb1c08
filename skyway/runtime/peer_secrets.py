"""Hashes of other services' secrets: enough to recognise a caller, and useless to a thief.

The secrets hold 256 random bits, so a fast hash is enough.
"""

import hashlib


def peer_file(service: str) -> str:
    """The file in a service's secrets folder with the hash of another service's secret."""
    return f"service_{service}.sha256"


def account_file(user_name: str) -> str:
    """The file in the registry's secrets folder with the hash of a broker account's password."""
    return f"mqtt_{user_name}.hash"


def peer_hash(secret: str) -> str:
    """The hash of a service's secret, hexadecimal."""
    return hashlib.sha256(secret.encode()).hexdigest()
