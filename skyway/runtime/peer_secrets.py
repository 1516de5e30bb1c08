"""The files of a service's secrets folder: its secrets, and hashes of other services' secrets.

The hashes are enough to recognise a caller, and useless to a thief. The secrets hold 256 random
bits, so a fast hash is enough.
"""

import hashlib
from pathlib import Path

from skyway.runtime.errors import InvalidSettings


def read_secret(secrets_dir: Path, name: str) -> str:
    """The secret in a file of one line, as Docker and Kubernetes mount them: ``service_gateway``.

    Raises
    ------
    InvalidSettings
        The file is missing or empty.
    """
    try:
        secret = (secrets_dir / name).read_text(encoding="utf-8").strip()
    except OSError as error:
        raise InvalidSettings(f"SKYWAY_SECRETS_DIR holds no readable file {name}") from error
    if not secret:
        raise InvalidSettings(f"the file {name} in SKYWAY_SECRETS_DIR is empty")
    return secret


def peer_file(service: str) -> str:
    """The file in a service's secrets folder with the hash of another service's secret."""
    return f"service_{service}.sha256"


def account_file(user_name: str) -> str:
    """The file in the registry's secrets folder with the hash of a broker account's password."""
    return f"mqtt_{user_name}.hash"


def secret_hash(secret: str) -> str:
    """The hash that is stored of a random secret, and by which a shown one is looked up."""
    return hashlib.sha256(secret.encode()).hexdigest()
