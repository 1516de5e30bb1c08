"""The broker's files of accounts: those of the database and of our own processes."""

import asyncio
import fcntl
import logging
import os
import signal
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Set
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Final, Protocol

from skyway.contracts.broker_rules import DEPLOYMENT_OPERATOR
from skyway.runtime.errors import MqttUnavailable, ServiceUnavailable
from skyway.runtime.peer_secrets import account_file, read_secret
from skyway.runtime.sql.database import Database
from skyway_provider_registry.enrolment import credential_store

log = logging.getLogger(__name__)

#: Services whose passwords are secrets of the deployment, in the files ``mqtt_<name>``.
_SERVICES: Final = ("gateway", "registry", "composition")

#: Steps after a write until the broker is notified again: a whole interval lies between.
_LOOKS_UNTIL_REMINDER: Final = 2

#: Wall seconds between two tries to lock the files, and the most tries: 10 s.
_TRY_EVERY_S: Final = 0.02
_MOST_TRIES: Final = 500


#: Ends the connection of a client with this user name.
EndConnection = Callable[[str], Awaitable[None]]


class BrokerAccounts(Protocol):
    """The files in which a broker reads its accounts."""

    @property
    def lock_file(self) -> Path:
        """The file beside them that a replica locks before it writes."""
        ...

    def hash_password(self, password: str) -> str:
        """The hash of a password, as this broker reads it."""
        ...

    def write(
        self,
        accounts: Mapping[str, str],
        services: Mapping[str, str],
        revoked: Mapping[str, str],
        /,
    ) -> None:
        """Replace the files by these accounts, user name to hash, and by drones' ended keys."""
        ...


class PasswordFile:
    """Keeps the broker's files equal to the accounts; only this service writes them.

    Replicas write the same files in turns: each locks a file beside them before it reads the
    accounts, so no replica replaces newer files by what it has read earlier. The lock ends with its
    process.

    Parameters
    ----------
    broker_pid_file
        The file with the process id of a broker that reads the password file again on SIGHUP.
        None when the broker watches the password file by itself.
    end_connection
        Ends the connection of a drone with this account, which outlives its certificate. None where
        the broker ends it by itself.
    """

    def __init__(
        self,
        broker: BrokerAccounts,
        *,
        db: Database,
        secrets_dir: Path,
        broker_pid_file: Path | None,
        end_connection: EndConnection | None = None,
    ) -> None:
        self.hash_password = broker.hash_password
        self._broker = broker
        self._db = db
        self._secrets_dir = secrets_dir
        self._broker_pid_file = broker_pid_file
        self._end_connection = end_connection
        #: The drones without credentials, once the files say so.
        self._locked_out: Set[str] | None = None
        self._to_end: Set[str] = frozenset()
        self._service_hashes: Mapping[str, str] = {}
        self._operator_hash = ""
        self._writing = asyncio.Lock()
        self._requested = 1
        self._written = 0
        self._looks_until_reminder = 0

    async def refresh(self) -> None:
        """Return once the file has every account that is committed now.

        Calls that wait for a running write share the next one.

        Raises
        ------
        ServiceUnavailable
            The file could not be written; `step` will try again.
        """
        self._requested += 1
        mine = self._requested
        async with self._writing:
            if self._written < mine:
                await self._write()

    async def step(self) -> bool:
        """Step of a loop: write again after a failed write, or notify the broker once more.

        Mosquitto ignores a SIGHUP that comes while it still handles the previous one. It may have
        read the file already: the last account would stay locked out until the next change.
        """
        async with self._writing:
            if self._written < self._requested:
                await self._write()
            elif self._looks_until_reminder:
                self._looks_until_reminder -= 1
                await self._end_connections()
                if not self._looks_until_reminder:
                    self._to_end = frozenset()
                    self._notify_broker()
        return False

    async def _write(self) -> None:
        covers = self._requested
        if not self._service_hashes:
            self._operator_hash = self._hash_of_secret("operator")
            self._service_hashes = {name: self._hash_of_secret(name) for name in _SERVICES}
        try:
            async with self._turn():
                async with self._db.read() as connection:
                    accounts = await credential_store.every_hash(connection)
                    revoked = await credential_store.revoked_keys(connection)
                accounts[DEPLOYMENT_OPERATOR] = self._operator_hash
                await asyncio.to_thread(self._broker.write, accounts, self._service_hashes, revoked)
        except OSError as error:
            raise ServiceUnavailable("broker accounts", f"not written: {error}") from error
        locked_out = set(revoked.values()) - set(accounts)
        if self._locked_out is not None:
            self._to_end |= locked_out - self._locked_out
        self._locked_out = locked_out
        self._written = covers
        self._looks_until_reminder = _LOOKS_UNTIL_REMINDER
        self._notify_broker()

    async def _end_connections(self) -> None:
        """End the connections of drones whose credentials have ended since the last look."""
        if self._end_connection is not None:
            for account in sorted(self._to_end):
                with suppress(MqttUnavailable, OSError):
                    await self._end_connection(account)

    @asynccontextmanager
    async def _turn(self) -> AsyncIterator[None]:
        """Keep other replicas from writing during the block.

        Raises
        ------
        OSError
            The lock cannot be had.
        """
        with self._broker.lock_file.open("w") as file:
            for _ in range(_MOST_TRIES):
                with suppress(BlockingIOError):
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                await asyncio.sleep(_TRY_EVERY_S)
            else:
                raise TimeoutError(f"another registry holds {self._broker.lock_file}")
            yield

    def _hash_of_secret(self, name: str) -> str:
        if (self._secrets_dir / account_file(name)).exists():
            return read_secret(self._secrets_dir, account_file(name))
        return self.hash_password(read_secret(self._secrets_dir, f"mqtt_{name}"))

    def _notify_broker(self) -> None:
        if self._broker_pid_file is None:
            return
        try:
            os.kill(_broker_pid(self._broker_pid_file), signal.SIGHUP)
        except (OSError, ValueError) as error:
            # A broker that is not running reads the file when it starts.
            log.warning("broker not notified of its new accounts", extra={"reason": str(error)})


def _broker_pid(pid_file: Path) -> int:
    pid = int(pid_file.read_text())
    if pid <= 1:
        # 0 and below name process groups; 1 is never our broker.
        raise ValueError(f"{pid} is no broker's process id")
    return pid
