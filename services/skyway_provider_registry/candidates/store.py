"""All SQL of the fleet view: all providers and drones, and the changes since the last read."""

from collections.abc import Mapping, Sequence
from typing import Final

from sqlalchemy import BigInteger, and_, bindparam, exists, literal_column, or_, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.announced_networks import CachedNetworks
from skyway.drone.learned_values import AS_MODELLED
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import DroneModelId, ProviderId
from skyway.runtime.sql.connection import AnyRow
from skyway_provider_registry.candidates.reasons import CachedDrone, CachedProvider
from skyway_provider_registry.change_store import ONLY_ROW, ChangeMarks
from skyway_provider_registry.presence.drone_presence import SILENCE
from skyway_provider_registry.presence.learned_store import (
    LEARNED_COLUMNS,
    learned_of,
    with_learned,
)
from skyway_provider_registry.presence.store import IS_LAST_MISSION, LAST_MISSION
from skyway_provider_registry.providers import store as providers
from skyway_provider_registry.tables import (
    changes,
    drones,
    mission_hints,
    presence,
)

#: No change has a larger number.
_LAST_CHANGE: Final = 2**63 - 1
_SILENCE_MS: Final = round(SILENCE.total_seconds() * 1000)

_has_live_mission = exists().where(
    mission_hints.c.drone_id == drones.c.drone_id, mission_hints.c.is_live
)
#: Composition reported the end of the mission that the drone last named.
_own_mission_is_over = exists().where(
    mission_hints.c.mission_id == presence.c.mission_id, mission_hints.c.is_live.is_(False)
)
_is_busy = or_(_has_live_mission, presence.c.mission_id.is_not(None) & ~_own_mission_is_over)

_columns: Final = (
    drones.c.drone_id,
    drones.c.provider_id,
    drones.c.model_id,
    drones.c.home_station_id,
    drones.c.home_longitude_deg,
    drones.c.home_latitude_deg,
    drones.c.initial_soc,
    drones.c.is_in_maintenance,
    drones.c.maintenance_due_ms,
    drones.c.standby,
    presence.c.connection_status,
    presence.c.last_seen_wall_ms,
    presence.c.activity,
    presence.c.station_id,
    presence.c.longitude_deg,
    presence.c.latitude_deg,
    presence.c.soc,
    _is_busy.label("is_busy"),
    LAST_MISSION.c.free_ms,
    LAST_MISSION.c.free_station_id,
    LAST_MISSION.c.free_soc,
    *LEARNED_COLUMNS,
)
_drones_with_presence: Final = with_learned(
    drones.join(presence, presence.c.drone_id == drones.c.drone_id)
).outerjoin(LAST_MISSION, IS_LAST_MISSION)
_EVERY_DRONE: Final = select(*_columns).select_from(_drones_with_presence)
#: PostgreSQL expects few rows from a range with two ends. From an open range it expects a third of
#: the table, and then it reads all mission hints.
_has_changed: Final = and_(
    presence.c.changed > bindparam("since", type_=BigInteger),
    presence.c.changed <= literal_column(str(_LAST_CHANGE), BigInteger),
)
#: The marks, and all drones that changed after a number; at least one row after the first change.
CHANGES: Final = (
    select(changes.c.latest, changes.c.providers, changes.c.removals, *_columns)
    .select_from(changes.outerjoin(_drones_with_presence, _has_changed))
    # Without this, PostgreSQL expects 1,500 rows of a small table that was never analysed.
    .where(changes.c.only == ONLY_ROW)
)

Rows = Sequence[AnyRow]


async def cached_providers(connection: AsyncConnection) -> dict[ProviderId, CachedProvider]:
    """All providers by id."""
    return {
        provider.provider_id: CachedProvider(
            provider_id=provider.provider_id,
            tariff=provider.tariff,
            is_active=provider.state == "ACTIVE",
            loading=provider.loading,
            standby=provider.standby,
        )
        for provider in await providers.every(connection)
    }


async def every_drone(connection: AsyncConnection) -> Rows:
    """The current data of each drone, for `cached_drone`."""
    return (await connection.execute(_EVERY_DRONE)).all()


async def changed_drones(connection: AsyncConnection, *, since: int) -> tuple[ChangeMarks, Rows]:
    """The committed marks, and the data of all drones that changed after the number `since`."""
    rows = (await connection.execute(CHANGES, {"since": since})).all()
    if not rows:
        return ChangeMarks(), ()
    first = rows[0]
    marks = ChangeMarks(first.latest, first.providers, first.removals)
    return marks, [row for row in rows if row.drone_id is not None]


def cached_drone(
    row: AnyRow, models: Mapping[DroneModelId, DroneModel], networks: CachedNetworks
) -> CachedDrone:
    """The drone of a row; before its first `state` it counts as offline and at no station.

    A drone that flies stands where it is free after all its missions, if that was reported.
    """
    has_reported = row.activity is not None
    # A drone that is due for maintenance flies the missions that it has, and gets no others.
    is_kept_back = row.is_in_maintenance or row.maintenance_due_ms is not None
    is_there = has_reported and row.connection_status == "ONLINE" and not is_kept_back
    home = Position(row.home_longitude_deg, row.home_latitude_deg)
    position = Position(row.longitude_deg, row.latitude_deg) if has_reported else home
    station_id, soc = (row.station_id, row.soc) if has_reported else (None, row.initial_soc)
    # An idle drone may fly before the missions that wait for later.
    is_free_later = row.is_busy and row.free_ms is not None and has_reported
    if is_free_later:
        station_id, soc = row.free_station_id, row.free_soc
        position = networks.position_if_connected(station_id, to=()) or position
    return CachedDrone(
        drone_id=row.drone_id,
        provider_id=row.provider_id,
        model=models[row.model_id],
        home_station_id=row.home_station_id,
        online_until_ms=row.last_seen_wall_ms + _SILENCE_MS if is_there else 0,
        station_id=station_id,
        position=position,
        soc=soc,
        is_busy=bool(row.is_busy and not is_free_later),
        free_ms=row.free_ms if is_free_later else 0,
        standby=row.standby,
        learned=(
            AS_MODELLED
            if row.flights is None and row.battery_id is None
            else learned_of(row).planned
        ),
    )
