"""A folder for each service with what it reads of the secrets, and nothing else."""

from pathlib import Path
from typing import Final

from skyway.broker_setup.nats_accounts import hash_for_nats
from skyway.broker_setup.passwords import hash_password
from skyway.broker_setup.private_file import write_private
from skyway.cli.data_folder import DataFolder
from skyway.cli.system.children import is_nats
from skyway.runtime.metrics import METRICS_KEY
from skyway.runtime.peer_secrets import account_file, peer_file, secret_hash
from skyway.runtime.signing.cloud_key_file import CLOUD_KEYS

#: The secrets that each service itself shows, or decrypts and signs with.
OWN: Final = {
    "registry": ("service_registry", "mqtt_registry", CLOUD_KEYS, METRICS_KEY),
    "composition": ("service_composition", "mqtt_composition", "signing_composition", METRICS_KEY),
    "gateway": (
        "service_gateway",
        "mqtt_gateway",
        "signing_gateway",
        "webhook_keys",
        "tracking_key",
        "operator_key",
        "customer_key",
        METRICS_KEY,
    ),
}

#: The services that each service recognises when they call; it gets hashes of their secrets.
PEERS: Final = {
    "registry": ("gateway", "composition"),
    "composition": ("gateway", "registry"),
    "gateway": ("composition",),
}

#: The broker accounts of others that the registry writes into the broker's files.
_ACCOUNTS: Final = ("gateway", "composition", "operator")

#: The folder with the keys of commands, such as the example fleet.
_COMMANDS: Final = "commands"


def write_service_secrets(folder: DataFolder, target: Path) -> None:
    """Write `target/registry`, `/composition`, `/gateway`, and `/commands` with keys.env."""
    for service, names in OWN.items():
        place = target / service
        place.mkdir(parents=True, exist_ok=True, mode=0o700)
        for name in names:
            write_private(place / name, (folder.secrets / name).read_text())
        for peer in PEERS[service]:
            hashed = secret_hash(_secret(folder, f"service_{peer}"))
            write_private(place / peer_file(peer), hashed + "\n")
        passfile = folder.secrets / f"pgpass_{service}"
        if passfile.exists():
            write_private(place / "pgpass", passfile.read_text())
    hash_for_broker = hash_for_nats if is_nats() else hash_password
    for account in _ACCOUNTS:
        hashed = hash_for_broker(_secret(folder, f"mqtt_{account}"))
        write_private(target / "registry" / account_file(account), hashed + "\n")
    (target / _COMMANDS).mkdir(exist_ok=True, mode=0o700)
    write_private(target / _COMMANDS / "keys.env", folder.keys_file.read_text())


def _secret(folder: DataFolder, name: str) -> str:
    return (folder.secrets / name).read_text().strip()
