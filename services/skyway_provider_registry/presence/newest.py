"""Which of a drone's messages counts: the newest by its own numbering, never by arrival."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TypeVar

from skyway.contracts.drone_report import Connection, DroneState, Telemetry
from skyway.ids import DroneId

PresenceMessage = Connection | DroneState | Telemetry
M = TypeVar("M", Connection, DroneState, Telemetry)

#: Of one connection: it begins ONLINE, and may be LOST or end with the drone's own OFFLINE.
_RANKS = {"ONLINE": 0, "LOST": 1, "OFFLINE": 2}


@dataclass(frozen=True, slots=True)
class Sighting:
    """The newest message of each topic that a batch held of one drone."""

    connection: Connection | None = None
    state: DroneState | None = None
    sample: Telemetry | None = None


def order_of(message: PresenceMessage) -> tuple[int, int, int]:
    """Where a message stands among those of its drone and topic.

    (session, seq, 0), or (session, connection_number, rank) for a `Connection`: the last will of
    an older connection comes before the present one, whenever it arrives.
    """
    if isinstance(message, Connection):
        return message.session, message.connection_number, _RANKS[message.status]
    return message.session, message.seq, 0


def newest(messages: Iterable[tuple[DroneId, PresenceMessage]]) -> dict[DroneId, Sighting]:
    """The newest message per drone and topic, sorted by drone."""
    sightings: dict[DroneId, Sighting] = {}
    for drone_id, message in messages:
        known = sightings.get(drone_id, Sighting())
        if isinstance(message, Connection):
            known = replace(known, connection=_later(known.connection, message))
        elif isinstance(message, DroneState):
            known = replace(known, state=_later(known.state, message))
        else:
            known = replace(known, sample=_later(known.sample, message))
        sightings[drone_id] = known
    return dict(sorted(sightings.items()))


def _later(known: M | None, message: M) -> M:
    return message if known is None or order_of(message) > order_of(known) else known
