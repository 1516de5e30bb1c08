"""Who works on a due row: a claim for a while, so that replicas never take the same one.

A claimant that dies loses its claims when they run out; whoever finishes frees them.
"""

from collections.abc import Sequence
from typing import Any, Final

from sqlalchemy import BigInteger, Column, ColumnElement, Row, Table, Text, bindparam, select

from skyway.runtime.clock import FleetClock
from skyway.runtime.database import Database
from skyway.units import moment_to_ms

#: The values that free a claim.
FREE: Final = {"claimed_by": None, "claimed_until_ms": 0}


def claim_columns() -> tuple[Column[str], Column[int]]:
    """The two columns of a table whose rows are claimed; wall time in milliseconds."""
    return (
        Column("claimed_by", Text),
        Column("claimed_until_ms", BigInteger, nullable=False, server_default="0"),
    )


async def claim(
    db: Database,
    table: Table,
    *,
    where: ColumnElement[bool],
    order_by: Sequence[ColumnElement[Any]],
    limit: int,
    claimant: str,
    lease_s: float,
    clock: FleetClock,
) -> list[Row[Any]]:
    """At most `limit` rows that nobody holds, now held by `claimant` for `lease_s` of wall time.

    Any: rows and sort columns have the types of their table.
    """
    now_ms = moment_to_ms(clock.wall_now())
    is_free = table.c.claimed_until_ms <= now_ms
    due = select(table).where(where, is_free).order_by(*order_by).limit(limit)
    async with db.write() as tx:
        rows = (await tx.execute(due.with_for_update(skip_locked=True))).all()
        if rows:
            key = [column.name for column in table.primary_key]
            taken = table.update().where(
                *(table.c[name] == bindparam(f"key_{name}") for name in key)
            )
            until_ms = now_ms + int(lease_s * 1000)
            await tx.execute(
                taken.values(claimed_by=claimant, claimed_until_ms=until_ms),
                [{f"key_{name}": getattr(row, name) for name in key} for row in rows],
            )
    return list(rows)
