"""What an enrolled drone keeps on disk, and shows to the broker and to REST.

The files lie beside the journals: one file per drone, readable by this user only.
"""

import os
import ssl
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Final

from pydantic import Field, ValidationError

from skyway.errors import SkywayError
from skyway.json_model import WireModel
from skyway_drone_agent.enrolled_drone import BrokerLogin, ClientCertificate, EnrolledDrone


class Credentials(WireModel):
    """The answer to a rotation of credentials."""

    mqtt: BrokerLogin
    certificate: ClientCertificate | None = None
    key: str = Field(repr=False)


class Enrolment(EnrolledDrone):
    """The answer to an enrolment."""

    key: str = Field(repr=False)


class KeptCredentials(WireModel):
    """An enrolled drone's credentials; the `following` ones may or may not be in force.

    `token_sha256` is that of the enrolment token, so that the same command line does not exchange
    the token twice.
    """

    api_url: str
    token_sha256: str
    drone: Enrolment
    following: Credentials | None = None

    def followed(self) -> "KeptCredentials":
        """The same with the following credentials in place of the current ones."""
        if self.following is None:
            return self
        new = {name: getattr(self.following, name) for name in Credentials.model_fields}
        drone = self.drone.model_copy(update=new)
        return self.model_copy(update={"drone": drone, "following": None})


_SUFFIX: Final = ".credentials.json"


class DamagedCredentials(SkywayError):
    """A file of credentials cannot be read; the drone needs another enrolment token."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"{path} is damaged: enrol the drone again with another token")
        self.path = path


class CredentialsFolder:
    """Reads and replaces credentials; once `keep` has returned, they are safe on disk."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def every(self) -> tuple[KeptCredentials, ...]:
        """The credentials of all drones that enrolled here, sorted by their ids."""
        return tuple(_read(path) for path in sorted(self._path.glob(f"*{_SUFFIX}")))

    def keep(self, credentials: KeptCredentials) -> None:
        """Keep these credentials in place of the drone's earlier ones."""
        name = f"{credentials.drone.drone_id}{_SUFFIX}"
        self._replace(name, credentials.model_dump_json())

    def attempt(self, token_sha256: str, *, new_key: str) -> str:
        """The idempotency key of this token's exchange: the first one that was given.

        When an answer is lost, a call with the same key gets the same answer.
        """
        path = self._path / _attempt(token_sha256)
        if not path.exists():
            self._replace(path.name, new_key)
        return path.read_text().strip()

    def forget_attempt(self, token_sha256: str) -> None:
        """Delete the idempotency key: the exchange is over."""
        (self._path / _attempt(token_sha256)).unlink(missing_ok=True)

    def _replace(self, name: str, text: str) -> None:
        self._path.mkdir(parents=True, exist_ok=True, mode=0o700)
        # The process id is in the name: agents of other drones may share the folder.
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
        # Without the text of the error, which may hold a password.
        raise DamagedCredentials(path) from error


def client_tls(certificate: ClientCertificate, *, scratch: Path) -> ssl.SSLContext:
    """TLS that trusts only the deployment's own authority, and shows the drone's certificate.

    `scratch` is a folder that only this user can read: Python reads private keys from files only.
    """
    context = ssl.create_default_context(cadata=certificate.ca_pem)
    with NamedTemporaryFile(dir=scratch, prefix=".tls-", suffix=".pem") as file:
        file.write(f"{certificate.private_key_pem}{certificate.certificate_pem}".encode())
        file.flush()
        context.load_cert_chain(file.name)
    return context
