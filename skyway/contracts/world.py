"""Cloud to all clients, retained: the fleet clock, pads of a station, version of a network."""

from typing import Annotated

from pydantic import Field

from skyway.contracts.message import FleetMoment, Message, WallMoment
from skyway.ids import NetworkId, StationId


class ClockAnchor(Message):
    """Fleet time = fleet_at + (wall time - wall_at) * rate."""

    fleet_at: FleetMoment
    wall_at: WallMoment
    rate: Annotated[float, Field(gt=0, description="Fleet seconds per wall second.")]


class StationState(Message):
    """How many pads of a station are taken now, and when the next reservation ends.

    `queue` counts the reservations that have not begun.
    """

    station_id: StationId
    pads: Annotated[int, Field(ge=0, description="How many pads the station has.")]
    pads_taken: Annotated[
        int,
        Field(
            ge=0,
            description="How many of them are reserved now or out of order, each counted once.",
        ),
    ]
    queue: Annotated[int, Field(ge=0, description="How many reservations have not begun.")] = 0
    next_free_at: FleetMoment | None = None


class NetworkVersion(Message):
    """The current version of a network, its content's hash, and where to read it."""

    network_id: NetworkId
    version: Annotated[int, Field(ge=1, description="The current version, from 1.")]
    sha256: Annotated[str, Field(description="SHA-256 of its content, in hexadecimal.")]
    href: Annotated[str, Field(description="The path where it can be read.")]
