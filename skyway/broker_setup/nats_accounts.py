"""The accounts of NATS and what each may read and write, as a file that its configuration includes.

NATS calls a topic a subject. Dots separate its levels, and its wildcards are ``*`` and ``>``.
"""

import json
import logging
import re
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import bcrypt

from skyway.broker_setup.private_file import write_private
from skyway.contracts.broker_rules import USER_NAME, BrokerRules
from skyway.errors import InvalidInput

log = logging.getLogger(__name__)

#: The cheapest cost that bcrypt knows, 2^4 rounds: passwords are random, and NATS checks all of
#: them again whenever an account is opened or closed.
_COST: Final = 4

#: bcrypt looks at no more of a password, and refuses a longer one.
_MOST_BYTES: Final = 72

_HASH: Final = re.compile(r"\$2[aby]\$\d\d\$[./A-Za-z0-9]{53}")

#: All accounts of Skyway are users of one account of NATS: they share their topics.
_ACCOUNT: Final = "SKYWAY"

_WILDCARDS: Final = {"+": "*", "#": ">"}


#: No account can have this name.
_PLACEHOLDER: Final = "."

#: The rights of an account that may write nothing: an empty list would allow everything.
_WRITES_NOTHING: Final = {"deny": ">"}


@dataclass(frozen=True, slots=True)
class NatsAccounts:
    """Writes the file of accounts that the configuration of every node includes."""

    file: Path

    @property
    def lock_file(self) -> Path:
        """The file that a replica of the registry locks before it writes."""
        return self.file.with_name(f"{self.file.name}.lock")

    def hash_password(self, password: str) -> str:
        """The hash that is stored of a password."""
        return hash_for_nats(password)

    def write(
        self,
        accounts: Mapping[str, str],
        services: Mapping[str, str],
        _revoked: Mapping[str, str] | None = None,
        /,
    ) -> None:
        """Replace the file by these accounts, user name to hash; NATS asks for no certificates.

        Accounts with a hash for another broker are left out and counted in the log: they need new
        credentials.

        Raises
        ------
        InvalidInput
            A user name is not an identifier.
        OSError
            The file cannot be written.
        """
        all_hashes = {**accounts, **services}
        of_another_broker = sum(not is_nats_hash(hashed) for hashed in all_hashes.values())
        if of_another_broker:
            log.warning(
                "accounts without a password for NATS: rotate or renew their credentials",
                extra={"accounts": of_another_broker},
            )
        write_private(self.file, nats_accounts(all_hashes, BrokerRules()))


def hash_for_nats(password: str) -> str:
    """A salted bcrypt hash, the only kind that NATS reads.

    Raises
    ------
    InvalidInput
        The password is longer than 72 bytes.
    """
    secret = password.encode()
    if len(secret) > _MOST_BYTES:
        raise InvalidInput("password", f"has {len(secret)} bytes; NATS takes {_MOST_BYTES} at most")
    return bcrypt.hashpw(secret, bcrypt.gensalt(_COST)).decode()


def is_nats_hash(hashed: str) -> bool:
    """Whether NATS can check a password by this hash."""
    return _HASH.fullmatch(hashed) is not None


def nats_accounts(hashes: Mapping[str, str], rules: BrokerRules) -> str:
    """The accounts as text for the configuration.

    Parameters
    ----------
    hashes
        User name to hash. An account with a hash of another kind is left out: nobody could log in.

    Raises
    ------
    InvalidInput
        A user name is not an identifier: it would be read as a wildcard.
    """
    readable = {name: hashed for name, hashed in sorted(hashes.items()) if is_nats_hash(hashed)}
    users = [_placeholder(), *(_user(*account, rules) for account in readable.items())]
    lines = ",\n".join(json.dumps(user) for user in users)
    return f'"accounts": {{"{_ACCOUNT}": {{"jetstream": "enabled", "users": [\n{lines}\n]}}}}\n'


def _placeholder() -> dict[str, Any]:
    """A user whose random password is not stored: without users NATS accepts all clients."""
    hashed = hash_for_nats(secrets.token_urlsafe(32))
    denied = {"publish": _WRITES_NOTHING, "subscribe": _WRITES_NOTHING}
    return {"user": _PLACEHOLDER, "password": hashed, "permissions": denied}


def _user(name: str, hashed: str, rules: BrokerRules) -> dict[str, Any]:
    if not USER_NAME.fullmatch(name):
        raise InvalidInput("user_name", f"{name!r} is not 1 to 64 of A-Z a-z 0-9 _ -")
    writable = _subjects(rules.writable(name))
    return {
        "user": name,
        "password": hashed,
        "allowed_connection_types": ["MQTT"],
        "permissions": {
            "publish": {"allow": writable} if writable else _WRITES_NOTHING,
            "subscribe": {"allow": _subjects(rules.readable(name))},
        },
    }


def _subjects(filters: tuple[str, ...]) -> list[str]:
    return [".".join(_WILDCARDS.get(level, level) for level in each.split("/")) for each in filters]
