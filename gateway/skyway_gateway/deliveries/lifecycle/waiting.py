"""What a delivery shows while it waits for a drone."""

from typing import Annotated

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.json_model import JsonModel


class Waiting(JsonModel):
    """A request that could not be booked yet, because no drone that could fly it was free."""

    place: Annotated[
        int,
        Field(
            ge=1,
            description="Its place among the waiting requests of its class and network, by the "
            "moment of asking; 1 is next.",
        ),
    ]
    since_at: FleetMoment
