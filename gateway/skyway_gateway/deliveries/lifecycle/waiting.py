"""What a delivery shows while it waits for a drone."""

from collections.abc import Iterable
from datetime import datetime
from typing import Annotated

from pydantic import Field

from skyway.contracts.candidate import FREE_AT, ProviderReason
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
    earliest_start_at: Annotated[
        FleetMoment | None,
        Field(
            description="When the first of the drones that were asked is free for another mission; "
            "null if that is not known."
        ),
    ] = None

    @staticmethod
    def earliest_start(reasons: Iterable[ProviderReason]) -> FleetMoment | None:
        """The earliest moment that the reasons of a booking round name."""
        return min(
            (
                datetime.fromisoformat(each.data[FREE_AT])
                for each in reasons
                if each.code == "BUSY" and FREE_AT in each.data
            ),
            default=None,
        )
