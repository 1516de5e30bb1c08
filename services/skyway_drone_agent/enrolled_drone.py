"""A drone as its provider enrolled it, and the file that holds one or many of them."""

import json
from pathlib import Path

from pydantic import Field, TypeAdapter, ValidationError

from skyway.contracts.message import Soc
from skyway.drone.model import DroneModel
from skyway.errors import InvalidInput
from skyway.geo import Position
from skyway.ids import DroneId, ProviderId, StationId
from skyway.json_model import WireModel
from skyway_drone_agent.journal.logbook import Logbook


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
    certificate: ClientCertificate | None = None

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
        content = json.loads(path.read_bytes())
        if isinstance(content, dict):
            content = content.get("items", [content])
        return _DRONES.validate_python(content)
    except json.JSONDecodeError as error:
        raise InvalidInput(str(path), f"not JSON: {error}") from error
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        raise InvalidInput(
            str(path),
            f"not the answer of POST /v1/providers/{{id}}/drones: {place}: {first['msg']}",
        ) from error
