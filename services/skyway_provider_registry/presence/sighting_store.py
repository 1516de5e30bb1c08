"""The newest message of each drone, by the drone's own numbers, and the SQL that stores it."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, Final, TypeVar

from sqlalchemy import BigInteger, Double, Text, Update, bindparam, tuple_

from skyway.contracts.drone_report import Connection, DroneState, Telemetry
from skyway.ids import DroneId
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_provider_registry.change_store import next_change
from skyway_provider_registry.presence.drone_presence import condition_text
from skyway_provider_registry.presence.jump import Ahead
from skyway_provider_registry.presence.wear import Wear
from skyway_provider_registry.tables import learned_values, presence

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


_ORDER_OF_CONNECTION: Final = ("connection_session", "connection_number", "connection_rank")
_ORDER_OF_STATE: Final = ("state_session", "state_seq")
_ORDER_OF_SAMPLE: Final = ("sample_session", "sample_seq")
#: The counters that grow with each state.
_WEAR: Final[dict[str, Any]] = {
    name: presence.c[name] + bindparam(f"more_{name}", type_=Double)
    for name in ("flown_s", "used_soc")
}
#: The parameter for a message's place in its topic, from the column's name.
_NEW: Final = "new_{}".format


@dataclass(frozen=True, slots=True)
class ReceptionTime:
    """When a batch was received, in fleet time and in wall time."""

    fleet_at: datetime
    wall_at: datetime


async def begin(tx: Tx, drone_ids: Iterable[DroneId], *, change: int) -> None:
    """Add the rows of new drones."""
    order = (*_ORDER_OF_CONNECTION, *_ORDER_OF_STATE, *_ORDER_OF_SAMPLE)
    no_message = dict.fromkeys(order, -1) | {"changed": change}
    await tx.execute(presence.insert(), [{"drone_id": one, **no_message} for one in drone_ids])


async def forget_order(tx: Tx, drone_ids: Collection[DroneId]) -> None:
    """Accept the next message of these drones on each topic, with any numbers."""
    change = await next_change(tx)
    order = (*_ORDER_OF_CONNECTION, *_ORDER_OF_STATE, *_ORDER_OF_SAMPLE)
    forgotten = dict.fromkeys(order, -1) | {"changed": change}
    rows = presence.c.drone_id.in_(sorted(drone_ids))
    await tx.execute(presence.update().where(rows).values(forgotten))
    learned = learned_values.c.drone_id.in_(sorted(drone_ids))
    await tx.execute(
        learned_values.update().where(learned).values(learned_session=-1, learned_seq=-1)
    )


async def record(
    tx: Tx,
    sightings: Mapping[DroneId, Sighting],
    received_at: ReceptionTime,
    *,
    ahead: Mapping[DroneId, Ahead],
    wear: Mapping[DroneId, Wear],
) -> None:
    """Store each message that is newer than the stored one, separately for each topic.

    The sightings are sorted by drone, so that two replicas cannot deadlock. A drone that is not in
    `ahead` or `wear` was not compared with an earlier state. Wear is added with its state, so each
    state adds it once.
    """
    change = await next_change(tx) if any(map(_affects_selection, sightings.values())) else 0
    connections, states, samples = [], [], []
    for drone_id, sighting in sightings.items():
        about = {
            "about": drone_id,
            "last_seen_ms": moment_to_ms(received_at.fleet_at),
            "last_seen_wall_ms": moment_to_ms(received_at.wall_at),
        }
        if (connection := sighting.connection) is not None:
            row = {"connection_status": connection.status, "changed": change}
            connections.append(about | _order(_ORDER_OF_CONNECTION, connection) | row)
        if (state := sighting.state) is not None:
            lead, worn = ahead.get(drone_id, Ahead()), wear.get(drone_id, Wear())
            states.append(
                about
                | _order(_ORDER_OF_STATE, state)
                | {
                    "state_at_ms": moment_to_ms(state.at),
                    "state_seen_ms": moment_to_ms(received_at.fleet_at),
                    "activity": state.activity,
                    "mission_id": state.mission_id,
                    "station_id": state.station_id,
                    "longitude_deg": state.position.longitude_deg,
                    "latitude_deg": state.position.latitude_deg,
                    "soc": state.soc,
                    "ahead_m": lead.length_m,
                    "ahead_soc": lead.soc,
                    "more_flown_s": worn.flown_s,
                    "more_used_soc": worn.used_soc,
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


def _affects_selection(sighting: Sighting) -> bool:
    """Whether selection depends on it; it does not depend on samples."""
    return sighting.connection is not None or sighting.state is not None


def _order(names: tuple[str, ...], message: PresenceMessage) -> dict[str, Any]:
    """The message's place in its topic, for `_if_later`."""
    return {_NEW(name): value for name, value in zip(names, order_of(message), strict=False)}


def _if_later(names: tuple[str, ...]) -> Update:
    """An update of one drone's row, which changes it only for a later message."""
    stored = tuple_(*(presence.c[name] for name in names))
    new = {name: bindparam(_NEW(name), type_=BigInteger) for name in names}
    is_about = presence.c.drone_id == bindparam("about", type_=Text)
    sums = _WEAR if names == _ORDER_OF_STATE else {}
    statement = presence.update().where(is_about, stored < tuple_(*new.values()))
    return statement.values(new | sums)


# Built once: building a statement takes as long as running it.
_IF_LATER: Final = {
    order: _if_later(order) for order in (_ORDER_OF_CONNECTION, _ORDER_OF_STATE, _ORDER_OF_SAMPLE)
}
