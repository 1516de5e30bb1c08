"""Who may come in: the accounts of the password file, read again whenever it changes."""

import logging
from pathlib import Path

from skyway.contracts.broker_rules import SERVICE_ACCOUNTS
from skyway.runtime.mqtt.broker_passwords import matches, read_password_file

log = logging.getLogger(__name__)


class Gate:
    """The accounts of a password file; nobody is anonymous, and no file means no accounts."""

    def __init__(self, password_file: Path) -> None:
        self._file = password_file
        self._seen: tuple[int, int, int] | None = None
        self._accounts: dict[str, str] = {}

    def refresh(self) -> bool:
        """Read the file if it was replaced, and tell whether it was.

        A file that is missing for a moment changes nothing: the last accounts stay.
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
    """The place that a client takes; whoever takes it again puts the former holder out.

    Drones and customers have one place each, whatever client id they send; the replicas of a
    service differ by theirs. No account can take a place of another.
    """
    return f"{user_name}/{client_id}" if user_name in SERVICE_ACCOUNTS else user_name
