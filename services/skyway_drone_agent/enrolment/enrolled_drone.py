"""A drone as its provider enrolled it, and its credentials for the broker and for REST.

The files of credentials lie beside the journals: one file per drone, readable by this user only.
"""

import contextlib
import os
import ssl
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Final

from pydantic import Field, TypeAdapter, ValidationError

from skyway.complaints import fault_of
from skyway.contracts.broker_rules import drone_account
from skyway.contracts.message import Soc
from skyway.contracts.signature import CloudKeys
from skyway.drone.model import DroneModel
from skyway.errors import InvalidInput
from skyway.geo import Position
from skyway.ids import DroneId, ProviderId, StationId
from skyway.json_model import WireModel
from skyway.json_text import json_value
from skyway.runtime.errors import InvalidSettings
from skyway_drone_agent.journal.logbook import Logbook

_SUFFIX: Final = ".credentials.json"


class BrokerLogin(WireModel):
    """The broker login that the registry showed once."""

    user_name: str
    password: str = Field(repr=False)


class ClientCertificate(WireModel):
    """The certificate for a broker that asks for more than a password."""

    certificate_pem: str
    private_key_pem: str = Field(repr=False)
    ca_pem: str


class EnrolledDrone(WireModel):
    """A drone as the registry describes it at its registration or its enrolment."""

    drone_id: DroneId
    provider_id: ProviderId
    model: DroneModel
    home_station_id: StationId
    home_position: Position
    #: The last place in the cloud's records, when the drone enrols on another computer.
    station_id: StationId | None = None
    position: Position | None = None
    soc: Soc
    mqtt: BrokerLogin
    #: The addresses of the broker; empty where the operator names none.
    mqtt_urls: tuple[str, ...] = ()
    certificate: ClientCertificate | None = None
    #: The drone's own key, with which it signs; None where it signs nothing.
    signing_key: str | None = Field(default=None, repr=False)
    cloud_keys: CloudKeys | None = None

    @property
    def user_name(self) -> str:
        """Its user name at the broker."""
        return drone_account(self.provider_id, self.drone_id)

    def at_first(self) -> Logbook:
        """The logbook of a drone without a journal: at its last place, or at home."""
        if self.station_id is not None and self.position is not None:
            return Logbook(station_id=self.station_id, position=self.position, soc=self.soc)
        return Logbook(station_id=self.home_station_id, position=self.home_position, soc=self.soc)


_DRONES: TypeAdapter[tuple[EnrolledDrone, ...]] = TypeAdapter(tuple[EnrolledDrone, ...])


def read_fleet(path: Path) -> tuple[EnrolledDrone, ...]:
    """The drones in a file: one drone, a list, or ``{"items": [...]}``.

    Raises
    ------
    InvalidInput
        The file does not hold the answer of POST /v1/providers/{id}/drones.
    """
    try:
        content = json_value(path.read_bytes())
        if isinstance(content, dict):
            content = content.get("items", [content])
        return _DRONES.validate_python(content)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        detail = "not the answer of POST /v1/providers/{id}/drones: " + ": ".join(fault_of(first))
        raise InvalidInput(str(path), detail) from error
    except ValueError as error:
        raise InvalidInput(str(path), f"not JSON: {error}") from error


class Credentials(WireModel):
    """The answer to a rotation of credentials."""

    mqtt: BrokerLogin
    mqtt_urls: tuple[str, ...] = ()
    certificate: ClientCertificate | None = None
    key: str = Field(repr=False)
    signing_key: str | None = Field(default=None, repr=False)
    cloud_keys: CloudKeys | None = None


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


class Attempt(WireModel):
    """The values that exchange a token: the call's idempotency key and the drone's own key."""

    idempotency_key: str = Field(repr=False)
    signing_key: str = Field(repr=False)


class DamagedCredentials(InvalidSettings):
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

    def attempt(self, token_sha256: str, *, new: Attempt) -> Attempt:
        """The attempt to exchange this token: the first one that was given.

        When an answer is lost, the same call gets the same answer.
        """
        path = self._path / _attempt(token_sha256)
        with contextlib.suppress(OSError, ValidationError):
            return Attempt.read(path.read_bytes())
        self._replace(path.name, new.model_dump_json())
        return new

    def forget_attempt(self, token_sha256: str) -> None:
        """Delete the attempt: the exchange is over."""
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
