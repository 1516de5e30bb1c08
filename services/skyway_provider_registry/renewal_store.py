"""All SQL of renewals: when the credentials of a drone changed, or were revoked.

The numbers of messages that came with the earlier credentials do not count for the later ones. They
are forgotten a few seconds after the renewal, when the broker has disconnected all who still used
the earlier credentials; and composition is notified then.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from sqlalchemy import BigInteger, Text, bindparam, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DroneId, NetworkId
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_provider_registry.tables import drones, renewals


@dataclass(frozen=True, slots=True)
class RenewalMoment:
    """When credentials were renewed, in fleet time and in wall time."""

    at: datetime
    wall_at: datetime


@dataclass(frozen=True, slots=True)
class DueRenewal:
    """A renewal of which composition was not notified yet."""

    drone_id: DroneId
    at: datetime
    wall_ms: int
    network_id: NetworkId


#: A renewal is announced unless there was another one meanwhile.
_ANNOUNCED: Final = (
    update(renewals)
    .where(
        renewals.c.drone_id == bindparam("of_drone", type_=Text),
        renewals.c.renewed_wall_ms == bindparam("of_wall_ms", type_=BigInteger),
    )
    .values(is_announced=True)
)


async def note(tx: Tx, drone_id: DroneId, moment: RenewalMoment) -> None:
    """Note that a drone's credentials are renewed."""
    statement = tx.insert(renewals).values(
        drone_id=drone_id,
        renewed_ms=moment_to_ms(moment.at),
        renewed_wall_ms=moment_to_ms(moment.wall_at),
        is_announced=False,
    )
    changed = ("renewed_ms", "renewed_wall_ms", "is_announced")
    await tx.execute(
        statement.on_conflict_do_update(
            index_elements=["drone_id"],
            set_={name: statement.excluded[name] for name in changed},
        )
    )


async def due(
    connection: AsyncConnection,
    *,
    until_wall_at: datetime,
    limit: int,
    without: Collection[NetworkId] = (),
) -> Sequence[DueRenewal]:
    """The renewals until this moment that were not announced, the oldest first.

    Those of drones at home in the networks `without` are left out.
    """
    query = (
        select(renewals, drones.c.network_id)
        .join(drones, drones.c.drone_id == renewals.c.drone_id)
        .where(
            renewals.c.is_announced.is_(False),
            renewals.c.renewed_wall_ms <= moment_to_ms(until_wall_at),
            drones.c.network_id.not_in(without),
        )
        .order_by(renewals.c.renewed_wall_ms)
        .limit(limit)
    )
    return [
        DueRenewal(
            DroneId(row.drone_id),
            ms_to_moment(row.renewed_ms),
            row.renewed_wall_ms,
            row.network_id,
        )
        for row in await connection.execute(query)
    ]


async def mark_announced(tx: Tx, announced: Sequence[DueRenewal]) -> None:
    """Note that composition knows of these renewals."""
    rows = [{"of_drone": each.drone_id, "of_wall_ms": each.wall_ms} for each in announced]
    await tx.execute(_ANNOUNCED, rows)


async def renewed_at(
    connection: AsyncConnection, drone_ids: Collection[DroneId]
) -> dict[DroneId, datetime]:
    """When the credentials of these drones were last renewed, fleet time."""
    query = select(renewals.c.drone_id, renewals.c.renewed_ms).where(
        renewals.c.drone_id.in_(sorted(drone_ids))
    )
    found = await connection.execute(query)
    return {DroneId(row.drone_id): ms_to_moment(row.renewed_ms) for row in found}
