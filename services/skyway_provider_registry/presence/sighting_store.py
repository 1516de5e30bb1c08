"""The SQL that keeps what drones say: guarded updates, so that it never moves backwards."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from sqlalchemy import BigInteger, Text, Update, bindparam, tuple_

from skyway.ids import DroneId
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_provider_registry.change_store import next_change
from skyway_provider_registry.presence.drone_presence import condition_text
from skyway_provider_registry.presence.newest import PresenceMessage, Sighting, order_of
from skyway_provider_registry.tables import presence

_ORDER_OF_CONNECTION: Final = ("connection_session", "connection_number", "connection_rank")
_ORDER_OF_STATE: Final = ("state_session", "state_seq")
_ORDER_OF_SAMPLE: Final = ("sample_session", "sample_seq")
#: What a message's place in its topic is called among a statement's parameters.
_NEW: Final = "new_{}".format


@dataclass(frozen=True, slots=True)
class Heard:
    """When something was heard, in both times."""

    fleet_at: datetime
    wall_at: datetime


async def begin(tx: Tx, drone_ids: Iterable[DroneId], *, change: int) -> None:
    """Make room for what new drones will tell."""
    order = (*_ORDER_OF_CONNECTION, *_ORDER_OF_STATE, *_ORDER_OF_SAMPLE)
    nothing_heard = dict.fromkeys(order, -1) | {"changed": change}
    await tx.execute(presence.insert(), [{"drone_id": one, **nothing_heard} for one in drone_ids])


async def record(tx: Tx, sightings: Mapping[DroneId, Sighting], heard: Heard) -> None:
    """Keep what is newer than what is known, each topic by itself.

    The sightings are sorted by drone, so that two replicas cannot wait for each other.
    """
    change = await next_change(tx) if any(map(_counts, sightings.values())) else 0
    connections, states, samples = [], [], []
    for drone_id, sighting in sightings.items():
        about = {
            "about": drone_id,
            "last_seen_ms": moment_to_ms(heard.fleet_at),
            "last_seen_wall_ms": moment_to_ms(heard.wall_at),
        }
        if (connection := sighting.connection) is not None:
            row = {"connection_status": connection.status, "changed": change}
            connections.append(about | _order(_ORDER_OF_CONNECTION, connection) | row)
        if (state := sighting.state) is not None:
            states.append(
                about
                | _order(_ORDER_OF_STATE, state)
                | {
                    "state_at_ms": moment_to_ms(state.at),
                    "activity": state.activity,
                    "mission_id": state.mission_id,
                    "station_id": state.station_id,
                    "longitude_deg": state.position.longitude_deg,
                    "latitude_deg": state.position.latitude_deg,
                    "soc": state.soc,
                    "condition": condition_text(state),
                    "changed": change,
                }
            )
        if (sample := sighting.sample) is not None:
            samples.append(
                about
                | _order(_ORDER_OF_SAMPLE, sample)
                | {
                    "sample_at_ms": moment_to_ms(sample.at),
                    "sample_longitude_deg": sample.position.longitude_deg,
                    "sample_latitude_deg": sample.position.latitude_deg,
                    "sample_soc": sample.soc,
                }
            )
    for order, rows in (
        (_ORDER_OF_CONNECTION, connections),
        (_ORDER_OF_STATE, states),
        (_ORDER_OF_SAMPLE, samples),
    ):
        if rows:
            await tx.execute(_IF_LATER[order], rows)


def _counts(sighting: Sighting) -> bool:
    """Whether selection must know of it; of samples it does not."""
    return sighting.connection is not None or sighting.state is not None


def _order(names: tuple[str, ...], message: PresenceMessage) -> dict[str, Any]:
    """The message's place in its topic, for `_if_later`."""
    return {_NEW(name): value for name, value in zip(names, order_of(message), strict=False)}


def _if_later(names: tuple[str, ...]) -> Update:
    """An update of one drone's row, which does nothing unless the message is later."""
    known = tuple_(*(presence.c[name] for name in names))
    new = {name: bindparam(_NEW(name), type_=BigInteger) for name in names}
    is_about = presence.c.drone_id == bindparam("about", type_=Text)
    return presence.update().where(is_about, known < tuple_(*new.values())).values(new)


# Made once: to make one takes as long as to run it.
_IF_LATER: Final = {
    order: _if_later(order) for order in (_ORDER_OF_CONNECTION, _ORDER_OF_STATE, _ORDER_OF_SAMPLE)
}
