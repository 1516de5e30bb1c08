"""The accounts that may connect, and the growing delay after wrong passwords."""

import asyncio
import logging
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from skyway.broker_setup.account_files import service_files
from skyway.broker_setup.passwords import hash_password, matches, read_password_file
from skyway_broker.refused_logins import RefusedLogins

log = logging.getLogger(__name__)

#: Wrong passwords of an address for an account that are answered immediately.
_FREE_MISTAKES: Final = 3
#: Seconds that the next attempt waits; each further wrong password doubles them, up to the most.
FIRST_DELAY_S: Final = 0.25
MOST_DELAY_S: Final = 8.0
#: Attempts of an address for an account that may wait at the same time.
_MOST_WAITING: Final = 4
#: Seconds without a wrong password after which all of them are forgotten.
_FORGOTTEN_AFTER_S: Final = 600.0
#: Pairs of address and account that are remembered, about 200 bytes each.
_MOST_REMEMBERED: Final = 20_000


class _AccountFile:
    """The accounts of one password file; none before the file exists."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._seen: tuple[int, int, int] | None = None
        self.accounts: dict[str, str] = {}

    def refresh(self) -> bool:
        """Read the file if it was replaced; True when it was read."""
        try:
            status = self._path.stat()
            seen = (status.st_ino, status.st_mtime_ns, status.st_size)
            if seen == self._seen:
                return False
            self.accounts = read_password_file(self._path)
        except OSError as error:
            if self._seen is not None:
                log.warning("password file unreadable", extra={"reason": str(error)})
            return False
        self._seen = seen
        log.info("accounts read", extra={"accounts": len(self.accounts)})
        return True


class Gate:
    """The accounts of a password file, and of the services' file beside it."""

    def __init__(self, password_file: Path) -> None:
        self.refused = RefusedLogins(password_file)
        self._clients = _AccountFile(password_file)
        self._services = _AccountFile(service_files(password_file).password_file)
        #: Compared when there is no such account: so the answer takes as long as for any other.
        self._unknown = hash_password("")

    def refresh(self) -> bool:
        """Read the files that were replaced; True when one was read.

        A file that is missing for a moment changes nothing: the accounts stay.
        """
        return any([self._clients.refresh(), self._services.refresh()])

    def admits(self, user_name: str | None, password: str | None) -> bool:
        """Whether this account exists and has this password; an unknown name takes as long."""
        hashed = self.hash_of(user_name or "")
        is_right = matches(password or "", self._unknown if hashed is None else hashed)
        return is_right and hashed is not None and password is not None

    def hash_of(self, user_name: str) -> str | None:
        """The hash of an account's password; another hash means another password."""
        return self._services.accounts.get(user_name) or self._clients.accounts.get(user_name)


class TooManyAttempts(Exception):
    """So many attempts for this account wait already from this address."""


class WrongPasswords:
    """Has an address wait before its next attempt for an account, longer after each mistake.

    Each pair of address and account waits for itself. So nobody can lock an account out from
    elsewhere, and no drone waits for the mistakes of another drone behind the same address.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        #: Wrong passwords, and when the last one came; the pair that came last is last.
        self._mistakes: dict[tuple[str, str], tuple[int, float]] = {}
        self._waiting: dict[tuple[str, str], int] = {}

    async def wait(self, address: str, user_name: str) -> None:
        """Return when the next attempt may be compared.

        Raises
        ------
        TooManyAttempts
            Others wait already: the attempt must not be compared.
        """
        delay_s, pair = self.delay_s(address, user_name), (address, user_name)
        if not delay_s:
            return
        waiting = self._waiting.get(pair, 0)
        if waiting >= _MOST_WAITING:
            raise TooManyAttempts
        self._waiting[pair] = waiting + 1
        try:
            await asyncio.sleep(delay_s)
        finally:
            self._waiting[pair] -= 1
            if not self._waiting[pair]:
                del self._waiting[pair]

    def delay_s(self, address: str, user_name: str) -> float:
        """Seconds that the next attempt waits."""
        count = self._count((address, user_name)) - _FREE_MISTAKES
        return 0.0 if count < 0 else min(FIRST_DELAY_S * 2.0 ** min(count, 30), MOST_DELAY_S)

    def note(self, address: str, user_name: str, *, was_right: bool) -> None:
        """Remember a wrong password, or forget all of them after the right one."""
        pair = (address, user_name)
        count = self._count(pair)
        self._mistakes.pop(pair, None)
        if was_right:
            return
        self._mistakes[pair] = (count + 1, self._now())
        if len(self._mistakes) > _MOST_REMEMBERED:
            del self._mistakes[next(iter(self._mistakes))]

    def _count(self, pair: tuple[str, str]) -> int:
        count, last_at = self._mistakes.get(pair, (0, 0.0))
        return count if self._now() - last_at < _FORGOTTEN_AFTER_S else 0
