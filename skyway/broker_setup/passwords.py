"""The broker's password file, in Mosquitto's `$7$` form, which both brokers read."""

import base64
import hashlib
import hmac
import os
import secrets
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from skyway.broker_setup.private_file import give_to_owner_of
from skyway.contracts.broker_rules import USER_NAME
from skyway.errors import InvalidInput

#: PBKDF2 rounds. Nobody chooses a password: each has 192 random bits or more, so a slow hash adds
#: nothing. Mosquitto hashes for known names only, and with 101 rounds that took measurably longer.
_ROUNDS: Final = 1
_SALT_BYTES: Final = 12
_KEY_BYTES: Final = 64


#: Hashes a password for storage.
PasswordHash = Callable[[str], str]


def hash_password(password: str) -> str:
    """A salted hash, as Mosquitto's password file holds it."""
    salt = secrets.token_bytes(_SALT_BYTES)
    key = _derive(password, salt, _ROUNDS)
    return f"$7${_ROUNDS}${_text(salt)}${_text(key)}"


def matches(password: str, hashed: str) -> bool:
    """Whether this is the hash of the password; False for a hash of another kind."""
    try:
        rounds, salt, expected = read_hash(hashed)
        actual = _derive(password, salt, rounds)
    except (ValueError, OverflowError):
        return False
    return hmac.compare_digest(actual, expected)


def read_hash(hashed: str) -> tuple[int, bytes, bytes]:
    """The rounds, the salt and the key of a hash.

    Raises
    ------
    ValueError
        It is not a hash of this kind.
    """
    nothing, kind, rounds, salt, key = hashed.split("$")
    if (nothing, kind) != ("", "7"):
        raise ValueError("not a hash of a password in the form $7$")
    return int(rounds), base64.b64decode(salt, validate=True), base64.b64decode(key, validate=True)


def write_password_file(path: Path, accounts: Mapping[str, str]) -> None:
    """Replace the file by these accounts (user name to hash), atomically and readable by us only.

    Raises
    ------
    InvalidInput
        A user name is not an identifier: it would be read as another line or as a wildcard.
    """
    for name in accounts:
        if not USER_NAME.fullmatch(name):
            raise InvalidInput("user_name", f"{name!r} is not 1 to 64 of A-Z a-z 0-9 _ -")
    text = "".join(f"{name}:{hashed}\n" for name, hashed in sorted(accounts.items()))
    # mkstemp makes the file 0600; the rename lets a reader see the old or the new one, whole.
    descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(descriptor, "w") as file:
            give_to_owner_of(path.parent, descriptor)
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def read_password_file(path: Path) -> dict[str, str]:
    """User name to hash of every account in the file."""
    lines = path.read_text().splitlines()
    return dict(line.split(":", 1) for line in lines if ":" in line and line[:1] != "#")


def _derive(password: str, salt: bytes, rounds: int) -> bytes:
    return hashlib.pbkdf2_hmac("sha512", password.encode(), salt, rounds, _KEY_BYTES)


def _text(raw: bytes) -> str:
    return base64.b64encode(raw).decode()
