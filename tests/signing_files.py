"""The cloud's signing keys in a folder of secrets, the same ones in all tests."""

from pathlib import Path
from typing import Final

from skyway.contracts.signature import CloudKeys
from skyway.runtime.signing.cloud_key_file import CLOUD_KEYS
from skyway.runtime.signing.key_pair import PrivateKey

#: By service.
SIGNING_KEYS: Final = {
    "composition": PrivateKey(b"c" * 32),
    "gateway": PrivateKey(b"g" * 32),
}

PUBLIC_KEYS: Final = CloudKeys(
    composition=(SIGNING_KEYS["composition"].public_key,),
    gateway=(SIGNING_KEYS["gateway"].public_key,),
)


def write_cloud_keys(folder: Path) -> None:
    """Write the public keys, and the key of each service that signs."""
    lines = [f"{service} {key.public_key}\n" for service, key in SIGNING_KEYS.items()]
    (folder / CLOUD_KEYS).write_text("".join(lines))
    for service, key in SIGNING_KEYS.items():
        (folder / f"signing_{service}").write_text(f"{key.text}\n")
