"""Composition asks the registry which drones may not begin a mission."""

from typing import Annotated, Final

from pydantic import Field

from skyway.ids import DroneId
from skyway.json_model import WireModel

#: Where composition asks.
OUT_OF_SERVICE: Final = "/internal/drones-out-of-service"

#: The most drones of one question.
MOST_DRONES: Final = 1_000


class OutOfServiceQuery(WireModel):
    """The drones that composition plans to send somewhere later."""

    drone_ids: Annotated[tuple[DroneId, ...], Field(max_length=MOST_DRONES)]


class OutOfServiceAnswer(WireModel):
    """Drones in MAINTENANCE, of a SUSPENDED provider, or not registered any more."""

    drone_ids: tuple[DroneId, ...]
