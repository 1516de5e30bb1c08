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
from skyway_drone_agent.logbook import Logbook


class BrokerLogin(WireModel):
    """What the registry showed once."""

    user_name: str
    password: str = Field(repr=False)


class EnrolledDrone(WireModel):
    """The answer to POST /v1/providers/{id}/drones, as far as the agent needs it."""

    drone_id: DroneId
    provider_id: ProviderId
    model: DroneModel
    home_station_id: StationId
    home_position: Position
    soc: Soc
    mqtt: BrokerLogin

    def at_first(self) -> Logbook:
        """The logbook of a drone that has never flown: it stands at home."""
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
