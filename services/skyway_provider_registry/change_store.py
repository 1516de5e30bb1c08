"""All SQL of the changes of drones: change numbers, and renewals of credentials.

Every write that candidates depend on gets the next number first, before it touches another row. Its
row lock lasts until the commit. So numbers are committed in order, and a reader that has seen a
number has seen all smaller numbers. Getting the number first also prevents deadlocks of writers.

The numbers of messages that came with the earlier credentials do not count for the later ones. They
are forgotten a few seconds after the renewal, when the broker has disconnected all who still used
the earlier credentials; and composition is notified then.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from sqlalchemy import BigInteger, Text, bindparam, select, update
from sqlalchemy.dialects import postgresql
from sqlalchemy.ext.asyncio import AsyncConnection
from sqlalchemy.sql.dml import ReturningInsert

from skyway.ids import DroneId, NetworkId
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_provider_registry.tables import changes, drones, renewals

#: The key of the only row.
ONLY_ROW: Final = 1


@dataclass(frozen=True, slots=True)
class ChangeMarks:
    """The numbers of the last change, of the last provider change and of the last removal."""

    latest: int = 0
    providers: int = 0
    removals: int = 0


async def next_change(tx: Tx) -> int:
    """The number of this write; the write stores it in `changed` of each row that it changes."""
    return await _number(tx, _NEXT)


async def mark_providers(tx: Tx) -> None:
    """Make every reader read the providers again."""
    await _number(tx, _NEXT_OF_PROVIDERS)


async def mark_removal(tx: Tx) -> None:
    """Make every reader read all drones again: a deleted row leaves no other trace."""
    await _number(tx, _NEXT_REMOVAL)


async def _number(tx: Tx, statement: ReturningInsert[*tuple[Any, ...]]) -> int:
    return int((await tx.execute(statement)).scalar_one())


def _numbering(*named: str) -> ReturningInsert[*tuple[Any, ...]]:
    """A statement that returns the next number; it also becomes the number of the named kinds."""
    first = {"only": ONLY_ROW, "latest": 1} | dict.fromkeys(("providers", "removals"), 0)
    following: dict[str, Any] = dict.fromkeys(("latest", *named), changes.c.latest + 1)
    # This also works with SQLite: both dialects write ON CONFLICT in the same way.
    statement = postgresql.insert(changes).values(first | dict.fromkeys(named, 1))
    statement = statement.on_conflict_do_update(index_elements=["only"], set_=following)
    return statement.returning(changes.c.latest)


_NEXT: Final = _numbering()
_NEXT_OF_PROVIDERS: Final = _numbering("providers")
_NEXT_REMOVAL: Final = _numbering("removals")


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
