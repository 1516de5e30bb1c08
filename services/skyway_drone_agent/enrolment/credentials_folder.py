"""Credentials on disk, beside the journals: one file per drone, for this user's eyes alone."""

import os
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from skyway.errors import SkywayError
from skyway_drone_agent.enrolment.credentials import KeptCredentials

_SUFFIX: Final = ".credentials.json"


class DamagedCredentials(SkywayError):
    """A file of credentials cannot be read: the drone needs another enrolment token."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"{path} is damaged: enrol the drone again with another token")
        self.path = path


class CredentialsFolder:
    """Reads and replaces credentials; what `keep` returned from is never lost or half there."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def every(self) -> tuple[KeptCredentials, ...]:
        """The credentials of all drones that enrolled here, sorted by their ids."""
        return tuple(_read(path) for path in sorted(self._path.glob(f"*{_SUFFIX}")))

    def keep(self, credentials: KeptCredentials) -> None:
        """Keep these, instead of what was kept for the drone before."""
        name = f"{credentials.drone.drone_id}{_SUFFIX}"
        self._replace(name, credentials.model_dump_json())

    def attempt(self, token_sha256: str, *, new_key: str) -> str:
        """The key under which this token's exchange is asked for: the first one ever given.

        An answer that is lost is repeated to whoever asks under the same key.
        """
        path = self._path / _attempt(token_sha256)
        if not path.exists():
            self._replace(path.name, new_key)
        return path.read_text().strip()

    def forget_attempt(self, token_sha256: str) -> None:
        """The exchange is over."""
        (self._path / _attempt(token_sha256)).unlink(missing_ok=True)

    def _replace(self, name: str, text: str) -> None:
        self._path.mkdir(parents=True, exist_ok=True, mode=0o700)
        # A name of its own: agents of other drones may share the folder.
        draft = self._path / f".{name}.{os.getpid()}"
        file = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(file, "w") as output:
            output.write(text + "\n")
            output.flush()
            os.fsync(output.fileno())
        draft.replace(self._path / name)
        folder = os.open(self._path, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def _attempt(token_sha256: str) -> str:
    return f"{token_sha256[:16]}.enrolling"


def _read(path: Path) -> KeptCredentials:
    try:
        return KeptCredentials.read(path.read_bytes())
    except ValidationError as error:
        # Not the error's own words: they may hold a password.
        raise DamagedCredentials(path) from error
