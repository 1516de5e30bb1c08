"""The files of the cloud's keys: the private key of each service, and the public keys for drones.

Each line of the public file names a service and one of its keys. While a key is replaced, a service
has two.
"""

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from skyway.contracts.signature import CloudKeys
from skyway.errors import InvalidInput
from skyway.runtime.errors import InvalidSettings
from skyway.runtime.peer_secrets import read_secret
from skyway.runtime.signing.key_pair import PrivateKey, public_key_bytes

#: Name of the file with the cloud's public keys, in the folder of secrets.
CLOUD_KEYS: Final = "cloud_keys"


def read_signing_key(secrets_dir: Path, service: str) -> PrivateKey:
    """The key with which this service signs; `InvalidSettings` names a missing file."""
    name = f"signing_{service}"
    try:
        return PrivateKey.read(read_secret(secrets_dir, name))
    except InvalidInput as error:
        raise InvalidSettings(f"{secrets_dir / name}: {error.detail}") from None


@dataclass(frozen=True, slots=True)
class CloudKeyFile:
    """The file, which is read anew for every drone: a change needs no restart."""

    path: Path

    def read(self) -> CloudKeys:
        """The keys.

        Raises
        ------
        InvalidSettings
            The file cannot be read, or a service has no valid key in it.
        """
        keys: dict[str, list[str]] = defaultdict(list)
        try:
            for line in self.path.read_text().splitlines():
                service, _, key = line.partition(" ")
                public_key_bytes(key.strip())
                keys[service].append(key.strip())
            found = CloudKeys.model_validate(keys)
        except (OSError, UnicodeDecodeError, InvalidInput, ValidationError) as error:
            raise _unusable(self.path) from error
        if not (found.composition and found.gateway):
            raise _unusable(self.path)
        return found


def _unusable(path: Path) -> InvalidSettings:
    return InvalidSettings(f"{path} names no valid key of each service: `skyway secrets` makes it")
