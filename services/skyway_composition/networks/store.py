"""All SQL of networks and their versions."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import (
    ColumnElement,
    Row,
    and_,
    bindparam,
    case,
    collate,
    delete,
    func,
    insert,
    select,
    update,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import NetworkId, StationId
from skyway.runtime.sql.database import Tx
from skyway_composition.tables import is_queued, missions, network_versions, networks, stations

# Built once, because every booking runs these statements and building takes longer than running.
_CURRENT: Final = select(networks).where(networks.c.network_id == bindparam("of_network"))
_ALL_CURRENT: Final = select(networks).order_by(networks.c.network_id)
_SHARE: Final = (
    select(networks.c.version, networks.c.conditions)
    .where(networks.c.network_id == bindparam("of_network"))
    .with_for_update(read=True)
)
_PRESENT: Final = select(networks.c.network_id, networks.c.version, networks.c.conditions).where(
    networks.c.network_id == bindparam("of_network")
)
_PRESENT_AROUND: Final = (
    select(networks.c.network_id, networks.c.version, networks.c.conditions)
    .join(stations, stations.c.network_id == networks.c.network_id)
    .where(stations.c.station_id == bindparam("of_station"))
)

#: The most versions that one transaction deletes: each may have megabytes.
_DELETED_TOGETHER: Final = 20


@dataclass(frozen=True, slots=True)
class VersionRow:
    """A version of a network, without its content."""

    network_id: NetworkId
    version: int
    sha256: str
    published_ms: int


@dataclass(frozen=True, slots=True)
class Present:
    """A network's current version, and the current number of its conditions."""

    network_id: NetworkId
    version: int
    conditions: int


async def current_version(connection: AsyncConnection, network_id: NetworkId) -> VersionRow | None:
    """The current version of a network."""
    found = await connection.execute(_CURRENT, {"of_network": network_id})
    row = found.one_or_none()
    return None if row is None else _version_row(row)


async def has_networks(connection: AsyncConnection) -> bool:
    """Whether any network is published."""
    found = await connection.execute(select(networks.c.network_id).limit(1))
    return found.one_or_none() is not None


async def lock_version(tx: Tx, network_id: NetworkId) -> VersionRow | None:
    """Lock the current version until this transaction ends, and return it."""
    found = await tx.execute(
        select(networks).where(networks.c.network_id == network_id).with_for_update()
    )
    row = found.one_or_none()
    return None if row is None else _version_row(row)


async def share_current(tx: Tx, network_id: NetworkId) -> Present | None:
    """The network as it is now, under a lock that readers share.

    Until this transaction ends, no other can publish, close or reopen in this network.
    """
    found = await tx.execute(_SHARE, {"of_network": network_id})
    row = found.one_or_none()
    return None if row is None else Present(network_id, row.version, row.conditions)


async def all_current(connection: AsyncConnection) -> list[VersionRow]:
    """The current versions of all networks."""
    found = await connection.execute(_ALL_CURRENT)
    return [_version_row(row) for row in found]


def by_bytes(connection: AsyncConnection, ids: ColumnElement[str]) -> ColumnElement[str]:
    """Ids in the order of their bytes, in which the gateway merges lists of several servers.

    A PostgreSQL database may sort by a language. SQLite sorts by bytes.
    """
    return collate(ids, "C") if connection.dialect.name == "postgresql" else ids


async def current_after(
    connection: AsyncConnection, network_id: str, *, without: Collection[NetworkId], limit: int
) -> list[VersionRow]:
    """The current versions of the networks whose ids follow this id."""
    ids = by_bytes(connection, networks.c.network_id)
    is_shown = and_(ids > network_id, networks.c.network_id.not_in(sorted(without)))
    found = await connection.execute(select(networks).where(is_shown).order_by(ids).limit(limit))
    return [_version_row(row) for row in found]


async def versions_before(
    connection: AsyncConnection, network_id: NetworkId, *, before: int, limit: int
) -> list[VersionRow]:
    """The versions of a network below `before`, newest first."""
    found = await connection.execute(
        select(
            network_versions.c.network_id,
            network_versions.c.version,
            network_versions.c.sha256,
            network_versions.c.published_ms,
        )
        .where(network_versions.c.network_id == network_id, network_versions.c.version < before)
        .order_by(network_versions.c.version.desc())
        .limit(limit)
    )
    return [_version_row(row) for row in found]


async def content(connection: AsyncConnection, network_id: NetworkId, version: int) -> bytes | None:
    """The GeoJSON of a version."""
    found = await connection.execute(
        select(network_versions.c.content).where(
            network_versions.c.network_id == network_id, network_versions.c.version == version
        )
    )
    stored: bytes | None = found.scalar_one_or_none()
    return stored


async def present(connection: AsyncConnection, network_id: NetworkId) -> Present | None:
    """A network with its current version and conditions number."""
    found = await connection.execute(_PRESENT, {"of_network": network_id})
    row = found.one_or_none()
    return None if row is None else Present(*row)


async def present_around(connection: AsyncConnection, station_id: StationId) -> Present | None:
    """The network that has this station, with its current version and conditions number."""
    found = await connection.execute(_PRESENT_AROUND, {"of_station": station_id})
    row = found.one_or_none()
    return None if row is None else Present(*row)


async def add_version(tx: Tx, row: VersionRow, *, content: bytes) -> None:
    """Make this the current version; the caller replaces the network's stations."""
    values = {
        "version": row.version,
        "sha256": row.sha256,
        "published_ms": row.published_ms,
    }
    if row.version == 1:
        await tx.execute(insert(networks).values(network_id=row.network_id, **values))
    else:
        await tx.execute(
            update(networks).where(networks.c.network_id == row.network_id).values(values)
        )
    await tx.execute(
        insert(network_versions).values(network_id=row.network_id, content=content, **values)
    )


async def delete_replaced(tx: Tx, *, before_ms: int) -> bool:
    """Delete some versions that were replaced before this fleet time; whether there may be more.

    A network keeps all versions from the oldest one on with which a QUEUED mission was planned.
    """
    versions = network_versions.c
    # The version that was current at the moment; all older ones were replaced before.
    current_then = (
        select(versions.network_id, func.max(versions.version).label("version"))
        .where(versions.published_ms <= before_ms)
        .group_by(versions.network_id)
        .subquery()
    )
    planned = (
        select(func.min(missions.c.planned_version))
        .where(missions.c.network_id == networks.c.network_id, is_queued)
        .scalar_subquery()
    )
    needed = func.coalesce(planned, current_then.c.version)
    oldest = case((needed < current_then.c.version, needed), else_=current_then.c.version)
    found = await tx.execute(
        select(networks.c.network_id, networks.c.oldest_version, oldest.label("oldest"))
        .join(current_then, current_then.c.network_id == networks.c.network_id)
        .where(oldest > networks.c.oldest_version)
        .order_by(networks.c.network_id)
        .limit(1)
    )
    row = found.one_or_none()
    if row is None:
        return False
    kept_from = min(row.oldest, row.oldest_version + _DELETED_TOGETHER)
    this = networks.c.network_id == row.network_id
    await tx.execute(update(networks).where(this).values(oldest_version=kept_from))
    old = (versions.network_id == row.network_id) & (versions.version < kept_from)
    await tx.execute(delete(network_versions).where(old))
    return True


def _version_row(row: Row[*tuple[Any, ...]]) -> VersionRow:
    return VersionRow(row.network_id, row.version, row.sha256, row.published_ms)
