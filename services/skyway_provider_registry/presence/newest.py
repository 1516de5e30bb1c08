"""Which message of a drone counts: the newest by the drone's own numbers, not by arrival."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TypeVar

from skyway.contracts.drone_report import Connection, DroneState, Telemetry
from skyway.ids import DroneId

PresenceMessage = Connection | DroneState | Telemetry
M = TypeVar("M", Connection, DroneState, Telemetry)

#: The order of states of one connection: it begins ONLINE and ends LOST or OFFLINE.
_RANKS = {"ONLINE": 0, "LOST": 1, "OFFLINE": 2}


@dataclass(frozen=True, slots=True)
class Sighting:
    """The newest message of one drone in a batch, for each topic."""

    connection: Connection | None = None
    state: DroneState | None = None
    sample: Telemetry | None = None


def order_of(message: PresenceMessage) -> tuple[int, int, int]:
    """The place of a message among the messages of its drone and topic.

    (session, seq, 0), or (session, connection_number, rank) for a `Connection`. So the last will of
    an older connection counts as older than the present connection, whenever it arrives.
    """
    if isinstance(message, Connection):
        return message.session, message.connection_number, _RANKS[message.status]
    return message.session, message.seq, 0


def newest(messages: Iterable[tuple[DroneId, PresenceMessage]]) -> dict[DroneId, Sighting]:
    """The newest message per drone and topic, sorted by drone."""
    sightings: dict[DroneId, Sighting] = {}
    for drone_id, message in messages:
        sighting = sightings.get(drone_id, Sighting())
        if isinstance(message, Connection):
            sighting = replace(sighting, connection=_later(sighting.connection, message))
        elif isinstance(message, DroneState):
            sighting = replace(sighting, state=_later(sighting.state, message))
        else:
            sighting = replace(sighting, sample=_later(sighting.sample, message))
        sightings[drone_id] = sighting
    return dict(sorted(sightings.items()))


def _later(previous: M | None, message: M) -> M:
    if previous is None or order_of(message) > order_of(previous):
        return message
    return previous
