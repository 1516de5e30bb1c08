"""All SQL of presence: guarded updates, so that what is known never moves backwards."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    Insert,
    Row,
    Text,
    Update,
    bindparam,
    delete,
    func,
    select,
    tuple_,
    update,
)
from sqlalchemy.dialects import postgresql
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.mission import LIVE_MISSION_STATES, MissionReport
from skyway.geo import Position
from skyway.ids import DroneId, MissionId, ProviderId
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_provider_registry.changes.store import next_change
from skyway_provider_registry.presence.condition import condition_text
from skyway_provider_registry.presence.known import LastSample, LastState, Presence
from skyway_provider_registry.presence.newest import PresenceMessage, Sighting, order_of
from skyway_provider_registry.tables import drones, mission_hints, presence

#: Wall ms that an ended mission is remembered, so that a late copy of a report revives none.
_REMEMBERED_MS: Final = 24 * 3600 * 1000

#: Drone ids in one IN list: SQLite takes 32,766 parameters, plans want fewer.
_CHUNK: Final = 500

_ORDER_OF_CONNECTION: Final = ("connection_session", "connection_number", "connection_rank")
_ORDER_OF_STATE: Final = ("state_session", "state_seq")
_ORDER_OF_SAMPLE: Final = ("sample_session", "sample_seq")
#: What a message's place in its topic is called among a statement's parameters.
_NEW: Final = "new_{}".format

#: A row of any query; its columns are of every type.
AnyRow = Row[*tuple[Any, ...]]


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


async def owners(
    connection: AsyncConnection, drone_ids: Iterable[DroneId]
) -> dict[DroneId, ProviderId]:
    """The provider of each of these drones that is registered."""
    asked = sorted(set(drone_ids))
    found: dict[DroneId, ProviderId] = {}
    for start in range(0, len(asked), _CHUNK):
        some = drones.c.drone_id.in_(asked[start : start + _CHUNK])
        columns = select(drones.c.drone_id, drones.c.provider_id).where(some)
        rows = await connection.execute(columns)
        found.update((row.drone_id, row.provider_id) for row in rows)
    return found


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


async def record_reports(tx: Tx, reports: Sequence[MissionReport], *, wall_at: datetime) -> None:
    """Keep composition's words on missions that are news, and of drones of their own provider.

    What comes between two reports of the same state says the same, so keeping the first will do.
    """
    change, wall_ms = await next_change(tx), moment_to_ms(wall_at)
    words = [
        {
            "mission_id": report.mission_id,
            "about": report.drone_id,
            "of_provider": report.provider_id,
            "seq": report.seq,
            "mission_state": report.mission_state,
            "is_live": report.mission_state in LIVE_MISSION_STATES,
            "reported_wall_ms": wall_ms,
        }
        for report in reports
    ]
    await tx.execute(_KEEP_WORD, words)
    await tx.execute(_TOUCH, [{"about": word["about"], "change": change} for word in words])
    before_ms = wall_ms - _REMEMBERED_MS
    ended = [
        {"about": word["about"], "before_ms": before_ms} for word in words if not word["is_live"]
    ]
    if ended:
        await tx.execute(_FORGET, ended)


async def cut_off(tx: Tx, drone_id: DroneId) -> None:
    """Take a drone for lost: whom Mosquitto puts out, its last will is not sent."""
    change = await next_change(tx)
    was_connected = (presence.c.drone_id == drone_id) & presence.c.connection_status.is_not(None)
    await tx.execute(
        update(presence).where(was_connected).values(connection_status="LOST", changed=change)
    )


async def touch(tx: Tx, drone_id: DroneId) -> None:
    """Have every reader read this drone again."""
    change = await next_change(tx)
    await tx.execute(_TOUCH, {"about": drone_id, "change": change})


def presence_of(row: AnyRow) -> Presence:
    """What is known of a drone, from a row with the columns of `KNOWN`."""
    state = sample = None
    if row.activity is not None:
        state = LastState(
            session=row.state_session,
            at=ms_to_moment(row.state_at_ms),
            activity=row.activity,
            station_id=row.station_id,
            position=Position(row.longitude_deg, row.latitude_deg),
            soc=row.soc,
            condition=row.condition,
        )
    if row.sample_at_ms is not None:
        sample = LastSample(
            session=row.sample_session,
            at=ms_to_moment(row.sample_at_ms),
            position=Position(row.sample_longitude_deg, row.sample_latitude_deg),
            soc=row.sample_soc,
        )
    return Presence(
        connection=row.connection_status,
        state=state,
        sample=sample,
        mission_id=_mission_of(row),
        mission_state=row.live_mission_state,
        last_seen_at=_moment(row.last_seen_ms),
        last_seen_wall_at=_moment(row.last_seen_wall_ms),
    )


def _counts(sighting: Sighting) -> bool:
    """Whether selection must know of it; of samples it does not."""
    return sighting.connection is not None or sighting.state is not None


def _mission_of(row: AnyRow) -> MissionId | None:
    """The mission a drone is on; its own word does not count once composition said it is over."""
    if row.live_mission_id is not None:
        return MissionId(row.live_mission_id)
    is_over = row.own_mission_is_live is not None and not row.own_mission_is_live
    return None if is_over else row.mission_id


def _moment(moment_ms: int | None) -> datetime | None:
    return None if moment_ms is None else ms_to_moment(moment_ms)


def _order(names: tuple[str, ...], message: PresenceMessage) -> dict[str, Any]:
    """The message's place in its topic, for `_if_later`."""
    return {_NEW(name): value for name, value in zip(names, order_of(message), strict=False)}


def _if_later(names: tuple[str, ...]) -> Update:
    """An update of one drone's row, which does nothing unless the message is later."""
    known = tuple_(*(presence.c[name] for name in names))
    new = {name: bindparam(_NEW(name), type_=BigInteger) for name in names}
    is_about = presence.c.drone_id == bindparam("about", type_=Text)
    return presence.update().where(is_about, known < tuple_(*new.values())).values(new)


def _keep_word() -> Insert:
    """An insert of composition's word, unless its drone is not the provider's, or it is no news."""
    names = ("seq", "mission_state", "is_live", "reported_wall_ms")
    values = [
        bindparam(name, type_=mission_hints.c[name].type).label(name)
        for name in ("mission_id", *names)
    ]
    own = select(drones.c.drone_id, *values).where(
        drones.c.drone_id == bindparam("about", type_=Text),
        drones.c.provider_id == bindparam("of_provider", type_=Text),
    )
    # SQLite's compiler takes it as it is: both spell ON CONFLICT the same.
    new = postgresql.insert(mission_hints).from_select(["drone_id", "mission_id", *names], own)
    is_news = (mission_hints.c.seq < new.excluded.seq) & (
        mission_hints.c.mission_state != new.excluded.mission_state
    )
    changed = {name: new.excluded[name] for name in names}
    return new.on_conflict_do_update(index_elements=["mission_id"], set_=changed, where=is_news)


# Statements of every message and report are made once: to make one takes as long as to run it.

_IF_LATER: Final = {
    order: _if_later(order) for order in (_ORDER_OF_CONNECTION, _ORDER_OF_STATE, _ORDER_OF_SAMPLE)
}
_KEEP_WORD: Final = _keep_word()
_FORGET: Final = delete(mission_hints).where(
    mission_hints.c.drone_id == bindparam("about", type_=Text),
    mission_hints.c.is_live.is_(False),
    mission_hints.c.reported_wall_ms < bindparam("before_ms", type_=BigInteger),
)
_TOUCH: Final = (
    presence.update()
    .where(presence.c.drone_id == bindparam("about", type_=Text))
    .values(changed=bindparam("change", type_=BigInteger))
)

_live: Final = (
    select(mission_hints.c.drone_id, func.max(mission_hints.c.mission_id).label("mission_id"))
    .where(mission_hints.c.is_live)
    .group_by(mission_hints.c.drone_id)
    .subquery("live")
)
_live_hint: Final = mission_hints.alias("live_hint")
_own_hint: Final = mission_hints.alias("own_hint")

#: All that is known of each drone: its own words, and composition's on its missions.
KNOWN: Final = (
    select(
        presence,
        _live_hint.c.mission_id.label("live_mission_id"),
        _live_hint.c.mission_state.label("live_mission_state"),
        _own_hint.c.is_live.label("own_mission_is_live"),
    )
    .select_from(presence)
    .outerjoin(_live, _live.c.drone_id == presence.c.drone_id)
    .outerjoin(_live_hint, _live_hint.c.mission_id == _live.c.mission_id)
    .outerjoin(_own_hint, _own_hint.c.mission_id == presence.c.mission_id)
)
