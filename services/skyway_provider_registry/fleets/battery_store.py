"""All SQL of batteries: which drone each is in, and how many full charges it has given.

Each change of an installation gets the number of its change first (`change_store`). So no other
change of a battery or a drone comes between its reads and its writes.
"""

from collections.abc import Sequence
from datetime import datetime
from typing import Final

from sqlalchemy import case, delete, func, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import BatteryId, DroneId, ProviderId
from skyway.runtime.errors import Conflict, NotFound, RowRefused
from skyway.runtime.http.paging import PageQuery
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_provider_registry.change_store import next_change
from skyway_provider_registry.fleets.battery import (
    MOST_INSTALLATIONS,
    Battery,
    BatteryWithHistory,
    NewBatteryRow,
    PastInstallation,
)
from skyway_provider_registry.fleets.drone import FleetDrone
from skyway_provider_registry.presence import learned_store
from skyway_provider_registry.tables import batteries, drones, past_installations, presence

#: The most batteries of a provider: several for each drone that it may have. Our own choice.
MOST_BATTERIES: Final = 100_000

#: The full charges that a battery has given, in earlier installations and in the present one.
_given_soc = batteries.c.used_soc + case(
    (batteries.c.drone_id.is_(None), 0.0),
    else_=presence.c.used_soc - batteries.c.installed_used_soc,
)
_BATTERIES: Final = select(batteries, _given_soc.label("given_soc")).outerjoin(
    presence, presence.c.drone_id == batteries.c.drone_id
)


async def add(tx: Tx, new: Sequence[NewBatteryRow]) -> None:
    """Store new batteries of one provider: all or none.

    Raises
    ------
    Conflict
        SERIAL_TAKEN, or TOO_MANY_BATTERIES.
    """
    provider_id, serials = new[0].provider_id, [each.requested.serial for each in new]
    await refuse_too_many(tx.connection, provider_id, new=len(new))
    if taken := await taken_serials(tx.connection, provider_id, serials):
        raise _serial_taken(repr(min(taken)))
    rows = [
        {
            "battery_id": each.battery_id,
            "provider_id": each.provider_id,
            "model_id": each.requested.model_id,
            "serial": each.requested.serial,
            "capacity_j": each.capacity_j,
            "state_of_health": each.state_of_health,
            "health_observations": 0,
            "used_soc": 0.0,
            "created_ms": moment_to_ms(each.created_at),
        }
        for each in new
    ]
    try:
        await tx.execute(batteries.insert(), rows)
    except RowRefused as error:
        raise _serial_taken("of one of these batteries") from error


async def refuse_too_many(
    connection: AsyncConnection, provider_id: ProviderId, *, new: int
) -> None:
    """Go on only if the provider may have so many new batteries."""
    own = select(func.count()).where(batteries.c.provider_id == provider_id)
    if int((await connection.execute(own)).scalar_one()) + new > MOST_BATTERIES:
        raise Conflict("TOO_MANY_BATTERIES", f"the limit is {MOST_BATTERIES} batteries a provider")


async def taken_serials(
    connection: AsyncConnection, provider_id: ProviderId, serials: Sequence[str]
) -> set[str]:
    """The serials that other batteries of the provider have; at most 500 are asked about."""
    query = select(batteries.c.serial).where(
        batteries.c.provider_id == provider_id, batteries.c.serial.in_(serials)
    )
    return set((await connection.execute(query)).scalars())


def _serial_taken(serial: str) -> Conflict:
    return Conflict("SERIAL_TAKEN", f"serial {serial} belongs to another of your batteries")


async def one(
    connection: AsyncConnection, provider_id: ProviderId, battery_id: BatteryId
) -> BatteryWithHistory:
    """A battery of this provider, with its past installations.

    Raises
    ------
    NotFound
        The provider has no such battery.
    """
    row = await _row(connection, provider_id, battery_id)
    past = (
        select(past_installations)
        .where(past_installations.c.battery_id == battery_id)
        .order_by(past_installations.c.installed_ms.desc())
    )
    return BatteryWithHistory(
        **_shown(row).model_dump(),
        past_installations=tuple(_past(each) for each in await connection.execute(past)),
    )


async def some(
    connection: AsyncConnection, provider_id: ProviderId, battery_ids: Sequence[BatteryId]
) -> dict[BatteryId, Battery]:
    """These batteries of the provider, by id; at most 500 are asked about."""
    query = _BATTERIES.where(
        batteries.c.provider_id == provider_id, batteries.c.battery_id.in_(battery_ids)
    )
    return {row.battery_id: _shown(row) for row in await connection.execute(query)}


async def page(
    connection: AsyncConnection, provider_id: ProviderId, query: PageQuery
) -> Sequence[Battery]:
    """Up to limit + 1 batteries of this provider, sorted by id."""
    statement = _BATTERIES.where(batteries.c.provider_id == provider_id)
    if (after := query.after_id()) is not None:
        statement = statement.where(batteries.c.battery_id > after)
    statement = statement.order_by(batteries.c.battery_id).limit(query.limit + 1)
    return [_shown(row) for row in await connection.execute(statement)]


async def install(tx: Tx, drone: FleetDrone, battery_id: BatteryId, *, at: datetime) -> None:
    """Install a battery in a drone; the battery that the drone had before is removed.

    Raises
    ------
    NotFound
        The drone's provider has no such battery.
    Conflict
        BATTERY_INSTALLED, OTHER_MODEL, or ON_MISSION.
    """
    row = await _row(tx.connection, drone.provider_id, battery_id)
    if row.drone_id == drone.drone_id:
        return
    if row.drone_id is not None:
        raise _installed(row)
    if row.model_id != drone.model.model_id:
        raise Conflict(
            "OTHER_MODEL",
            f"battery {row.serial} fits drones of model {row.model_id}, and drone "
            f"{drone.drone_id} is of model {drone.model.model_id}",
        )
    refuse_on_mission(drone)
    await free(tx, drone.drone_id, at=at)
    await tx.execute(
        update(batteries)
        .where(batteries.c.battery_id == battery_id)
        .values(
            drone_id=drone.drone_id,
            installed_ms=moment_to_ms(at),
            installed_used_soc=await _used_soc(tx, drone.drone_id),
        )
    )
    await _note_change(tx, drone.drone_id, at=at)


async def remove_from(tx: Tx, drone: FleetDrone, *, at: datetime) -> None:
    """Remove the battery of a drone, which then counts as a drone with an unknown battery.

    Raises
    ------
    NotFound
        The drone has no registered battery.
    Conflict
        ON_MISSION.
    """
    refuse_on_mission(drone)
    if not await free(tx, drone.drone_id, at=at):
        raise NotFound("battery in drone", drone.drone_id)
    await _note_change(tx, drone.drone_id, at=at)


async def delete_one(tx: Tx, provider_id: ProviderId, battery_id: BatteryId) -> None:
    """Delete a battery that is in no drone.

    Raises
    ------
    NotFound
        The provider has no such battery.
    Conflict
        BATTERY_INSTALLED.
    """
    await next_change(tx)
    this = batteries.c.battery_id == battery_id
    found = await tx.execute(
        delete(batteries).where(
            this, batteries.c.provider_id == provider_id, batteries.c.drone_id.is_(None)
        )
    )
    if found.rowcount == 0:
        raise _installed(await _row(tx.connection, provider_id, battery_id))


def refuse_on_mission(drone: FleetDrone) -> None:
    """Go on only if the drone has no mission under way.

    Raises
    ------
    Conflict
        ON_MISSION.
    """
    if (mission_id := drone.presence.mission_id) is not None:
        raise Conflict("ON_MISSION", f"drone {drone.drone_id} is on mission {mission_id}")


def _installed(row: AnyRow) -> Conflict:
    where = f"battery {row.serial} ({row.battery_id}) is in drone {row.drone_id}"
    return Conflict("BATTERY_INSTALLED", f"{where}: remove it there first")


async def free(tx: Tx, drone_id: DroneId, *, at: datetime) -> bool:
    """Remove the battery of a drone and store this installation; False if the drone has none."""
    query = select(batteries).where(batteries.c.drone_id == drone_id)
    row = (await tx.execute(query)).one_or_none()
    if row is None:
        return False
    given_soc = await _used_soc(tx, drone_id) - row.installed_used_soc
    removed_ms = moment_to_ms(at)
    this = batteries.c.battery_id == row.battery_id
    await tx.execute(
        update(batteries)
        .where(this)
        .values(
            drone_id=None,
            installed_ms=None,
            installed_used_soc=None,
            used_soc=row.used_soc + given_soc,
        )
    )
    if removed_ms > row.installed_ms:
        past = {
            "battery_id": row.battery_id,
            "installed_ms": row.installed_ms,
            "removed_ms": removed_ms,
            "drone_id": drone_id,
            "used_soc": given_soc,
        }
        await tx.execute(past_installations.insert().values(past))
        await _delete_old(tx, row.battery_id)
    return True


async def _delete_old(tx: Tx, battery_id: BatteryId) -> None:
    """Keep only the newest past installations of a battery."""
    of_battery = past_installations.c.battery_id == battery_id
    oldest_kept = (
        select(past_installations.c.installed_ms)
        .where(of_battery)
        .order_by(past_installations.c.installed_ms.desc())
        .offset(MOST_INSTALLATIONS - 1)
        .limit(1)
        .scalar_subquery()
    )
    await tx.execute(
        delete(past_installations).where(
            of_battery, past_installations.c.installed_ms < oldest_kept
        )
    )


async def _note_change(tx: Tx, drone_id: DroneId, *, at: datetime) -> None:
    """Allow any charge in the drone's next state, and forget the health of its unknown battery."""
    this = drones.c.drone_id == drone_id
    await tx.execute(update(drones).where(this).values(battery_changed_ms=moment_to_ms(at)))
    await learned_store.forget_health(tx, drone_id)


async def _used_soc(tx: Tx, drone_id: DroneId) -> float:
    query = select(presence.c.used_soc).where(presence.c.drone_id == drone_id)
    return float((await tx.execute(query)).scalar_one())


async def _row(
    connection: AsyncConnection, provider_id: ProviderId, battery_id: BatteryId
) -> AnyRow:
    query = _BATTERIES.where(
        batteries.c.battery_id == battery_id, batteries.c.provider_id == provider_id
    )
    row: AnyRow | None = (await connection.execute(query)).one_or_none()
    if row is None:
        raise NotFound("battery", battery_id)
    return row


def _shown(row: AnyRow) -> Battery:
    return Battery(
        battery_id=row.battery_id,
        provider_id=row.provider_id,
        serial=row.serial,
        model_id=row.model_id,
        capacity_j=row.capacity_j,
        drone_id=row.drone_id,
        installed_at=None if row.installed_ms is None else ms_to_moment(row.installed_ms),
        cycles=round(row.given_soc, 2),
        state_of_health=round(row.state_of_health, 3),
        health_observations=row.health_observations,
    )


def _past(row: AnyRow) -> PastInstallation:
    return PastInstallation(
        drone_id=row.drone_id,
        installed_at=ms_to_moment(row.installed_ms),
        removed_at=ms_to_moment(row.removed_ms),
        cycles=round(row.used_soc, 2),
    )
