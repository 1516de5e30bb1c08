"""The accounts that may connect: those of the password file, read again when it changes."""

import logging
from pathlib import Path

from skyway.broker_setup.passwords import matches, read_password_file
from skyway.contracts.broker_rules import SERVICE_ACCOUNTS

log = logging.getLogger(__name__)


class Gate:
    """The accounts of a password file; without a file there are no accounts."""

    def __init__(self, password_file: Path) -> None:
        self._file = password_file
        self._seen: tuple[int, int, int] | None = None
        self._accounts: dict[str, str] = {}

    def refresh(self) -> bool:
        """Read the file if it was replaced; True when it was read.

        A file that is missing for a moment changes nothing: the accounts stay.
        """
        try:
            status = self._file.stat()
            seen = (status.st_ino, status.st_mtime_ns, status.st_size)
            if seen == self._seen:
                return False
            self._accounts = read_password_file(self._file)
        except OSError as error:
            if self._seen is not None:
                log.warning("password file unreadable", extra={"reason": str(error)})
            return False
        self._seen = seen
        log.info("accounts read", extra={"accounts": len(self._accounts)})
        return True

    def admits(self, user_name: str | None, password: str | None) -> bool:
        """Whether this account exists and has this password."""
        if not user_name or password is None:
            return False
        hashed = self._accounts.get(user_name)
        return hashed is not None and matches(password, hashed)


def place_of(user_name: str, client_id: str) -> str:
    """The place of a client; a new client with the same place disconnects the previous one.

    A drone and a customer have one place each, for all client ids. The replicas of a service have
    different client ids, and so different places. No account can use the place of another.
    """
    return f"{user_name}/{client_id}" if user_name in SERVICE_ACCOUNTS else user_name
