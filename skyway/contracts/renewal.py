"""The registry notifies composition which drones have other credentials from now on."""

from typing import Annotated, Final

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.ids import DroneId
from skyway.json_model import WireModel

#: Where the registry posts renewals.
RENEWALS: Final = "/internal/renewed-credentials"


class Renewal(WireModel):
    """The credentials of a drone have changed, or were revoked.

    Another sender may have used the earlier credentials. The numbers of its messages (session, seq,
    stream) say nothing about the messages that come with the new credentials.
    """

    drone_id: DroneId
    at: FleetMoment


class Renewals(WireModel):
    """The renewals of some drones."""

    renewals: Annotated[tuple[Renewal, ...], Field(max_length=500)]
