"""All SQL of the fleet view: who is there, and what has changed since it was read last."""

from collections.abc import Mapping, Sequence
from typing import Final

from sqlalchemy import BigInteger, and_, bindparam, exists, literal_column, or_, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import DroneModelId, ProviderId
from skyway.runtime.sql.connection import AnyRow
from skyway_provider_registry.candidates.reasons import KnownDrone, KnownProvider
from skyway_provider_registry.change_store import ONLY_ROW, ChangeMarks
from skyway_provider_registry.presence.drone_presence import SILENCE
from skyway_provider_registry.providers import store as providers
from skyway_provider_registry.tables import changes, drones, mission_hints, presence

#: No change has a number beyond it.
_LAST_CHANGE: Final = 2**63 - 1
_SILENCE_MS: Final = round(SILENCE.total_seconds() * 1000)

_has_live_mission = exists().where(
    mission_hints.c.drone_id == drones.c.drone_id, mission_hints.c.is_live
)
#: Composition said that the mission is over which the drone last named.
_own_mission_is_over = exists().where(
    mission_hints.c.mission_id == presence.c.mission_id, mission_hints.c.is_live.is_(False)
)
_is_busy = or_(_has_live_mission, presence.c.mission_id.is_not(None) & ~_own_mission_is_over)

_known: Final = (
    drones.c.drone_id,
    drones.c.provider_id,
    drones.c.model_id,
    drones.c.home_station_id,
    drones.c.home_longitude_deg,
    drones.c.home_latitude_deg,
    drones.c.initial_soc,
    drones.c.is_in_maintenance,
    presence.c.connection_status,
    presence.c.last_seen_wall_ms,
    presence.c.activity,
    presence.c.station_id,
    presence.c.longitude_deg,
    presence.c.latitude_deg,
    presence.c.soc,
    _is_busy.label("is_busy"),
)
_heard: Final = drones.join(presence, presence.c.drone_id == drones.c.drone_id)
_EVERY_DRONE: Final = select(*_known).select_from(_heard)
#: A range of which both ends are given is what PostgreSQL takes for few rows, whichever they are;
#: of an open one it expects a third of the table, and then reads all that was ever hinted at.
_has_changed: Final = and_(
    presence.c.changed > bindparam("since", type_=BigInteger),
    presence.c.changed <= literal_column(str(_LAST_CHANGE), BigInteger),
)
#: The marks, and all drones that changed after a number: one row at least, once there is anything.
CHANGES: Final = (
    select(changes.c.latest, changes.c.providers, changes.c.removals, *_known)
    .select_from(changes.outerjoin(_heard, _has_changed))
    # Said, since PostgreSQL takes a small table that was never analysed for 1,500 rows.
    .where(changes.c.only == ONLY_ROW)
)

Rows = Sequence[AnyRow]


async def known_providers(connection: AsyncConnection) -> dict[ProviderId, KnownProvider]:
    """All providers by id."""
    return {
        provider.provider_id: KnownProvider(
            provider_id=provider.provider_id,
            tariff=provider.tariff,
            is_active=provider.state == "ACTIVE",
            loading=provider.loading,
        )
        for provider in await providers.every(connection)
    }


async def every_drone(connection: AsyncConnection) -> Rows:
    """What is known of each drone now, for `known_drone`."""
    return (await connection.execute(_EVERY_DRONE)).all()


async def changed_drones(connection: AsyncConnection, *, since: int) -> tuple[ChangeMarks, Rows]:
    """The marks as they are committed, and what is known of the drones that changed after one."""
    rows = (await connection.execute(CHANGES, {"since": since})).all()
    if not rows:
        return ChangeMarks(), ()
    first = rows[0]
    marks = ChangeMarks(first.latest, first.providers, first.removals)
    return marks, [row for row in rows if row.drone_id is not None]


def known_drone(row: AnyRow, models: Mapping[DroneModelId, DroneModel]) -> KnownDrone:
    """The drone of a row; one that has not told of itself stands nowhere and is away for ever."""
    has_told = row.activity is not None
    is_there = has_told and row.connection_status == "ONLINE" and not row.is_in_maintenance
    home = Position(row.home_longitude_deg, row.home_latitude_deg)
    return KnownDrone(
        drone_id=row.drone_id,
        provider_id=row.provider_id,
        model=models[row.model_id],
        home_station_id=row.home_station_id,
        online_until_ms=row.last_seen_wall_ms + _SILENCE_MS if is_there else 0,
        station_id=row.station_id if has_told else None,
        position=Position(row.longitude_deg, row.latitude_deg) if has_told else home,
        soc=row.soc if has_told else row.initial_soc,
        is_busy=bool(row.is_busy),
    )
