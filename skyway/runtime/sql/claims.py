"""Claims on due rows: a claim lasts for a while, and no two replicas claim the same row.

A claimant frees the row when it has finished. The claims of a dead claimant run out.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, Self

from sqlalchemy import (
    BigInteger,
    Column,
    ColumnElement,
    Integer,
    Row,
    Table,
    Text,
    bindparam,
    or_,
    select,
    tuple_,
)
from sqlalchemy.sql.dml import ReturningUpdate

from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms

#: A claim that lasts longer than this is damaged, or of a machine whose clock was wrong, and does
#: not count. The longest lease is 20 s, and clocks may differ. Milliseconds of wall time.
LONGEST_CLAIM_MS: Final = 600_000

#: The values that free a claim.
FREE: Final = {"claimed_by": None, "claimed_until_ms": 0}

_NO_VALUES: Final[Mapping[str, ColumnElement[Any]]] = MappingProxyType({})

#: The moment of a claim within its statement, wall time in milliseconds.
NOW_MS: Final = bindparam("now_ms", type_=BigInteger)


def claim_columns() -> tuple[Column[str], Column[int]]:
    """The two columns of a table whose rows are claimed; wall time in milliseconds."""
    return (
        Column("claimed_by", Text),
        Column("claimed_until_ms", BigInteger, nullable=False, server_default="0"),
    )


def is_free(table: Table) -> ColumnElement[bool]:
    """Whether no claim of a row counts at `NOW_MS`."""
    until_ms = table.c.claimed_until_ms
    return or_(until_ms <= NOW_MS, until_ms > NOW_MS + LONGEST_CLAIM_MS)


@dataclass(frozen=True, slots=True)
class Claiming:
    """How rows of one table are claimed. It is made once, since making statements takes long."""

    statement: ReturningUpdate[*tuple[Any, ...]]  # rows have the types of their table
    order_by: tuple[Column[Any], ...]

    @classmethod
    def of(
        cls,
        table: Table,
        *,
        where: ColumnElement[bool],
        order_by: Sequence[ColumnElement[Any]],
        also: Mapping[str, ColumnElement[Any]] = _NO_VALUES,
        answers: Sequence[ColumnElement[Any]] = (),
    ) -> Self:
        """Rows that meet a condition, in this order; the condition may be about `NOW_MS`.

        The values of `also` are set in each row; `answers` are returned with each row. Expressions
        of the order decide which rows are claimed, not how those are sorted. Any: columns have the
        types of their table.
        """
        key = [*table.primary_key]
        due = (
            select(*key)
            .where(where, is_free(table))
            .order_by(*order_by)
            .limit(bindparam("most", type_=Integer))
            .with_for_update(skip_locked=True)
            # PostgreSQL could run a subquery more than once, and so claim more than the limit.
            .cte("due")
        )
        claimed = table.update().where(tuple_(*key).in_(select(*due.c)))
        new = {
            **also,
            "claimed_by": bindparam("claimant", type_=Text),
            "claimed_until_ms": bindparam("until_ms", type_=BigInteger),
        }
        columns = tuple(each for each in order_by if isinstance(each, Column))
        return cls(claimed.values(new).returning(table, *answers), columns)

    async def run(
        self, tx: Tx, *, limit: int, claimant: str, lease_s: float, clock: FleetClock
    ) -> list[Row[Any]]:
        """Claim at most `limit` free rows for `claimant`; the rows in order.

        Any: rows have the types of their table.
        """
        values = claim_values(limit=limit, claimant=claimant, lease_s=lease_s, clock=clock)
        return self.in_order(await tx.execute(self.statement, values))

    def in_order(self, claimed: Iterable[Row[Any]]) -> list[Row[Any]]:
        """What the statement returned, in the order of the claim."""
        return sorted(claimed, key=lambda row: [row._mapping[each] for each in self.order_by])


def claim_values(
    *, limit: int, claimant: str, lease_s: float, clock: FleetClock
) -> dict[str, object]:
    """The parameters of a claiming statement."""
    now_ms = moment_to_ms(clock.wall_now())
    return {
        "now_ms": now_ms,
        "most": limit,
        "claimant": claimant,
        "until_ms": now_ms + int(lease_s * 1000),
    }


async def claim(
    db: Database,
    table: Table,
    *,
    where: ColumnElement[bool],
    order_by: Sequence[Column[Any]],
    limit: int,
    claimant: str,
    lease_s: float,
    clock: FleetClock,
) -> list[Row[Any]]:
    """Claim at most `limit` free rows for `claimant`, for `lease_s` of wall time.

    Any: rows and sort columns have the types of their table.
    """
    claiming = Claiming.of(table, where=where, order_by=order_by)
    values = claim_values(limit=limit, claimant=claimant, lease_s=lease_s, clock=clock)
    return claiming.in_order(await db.write_alone(claiming.statement, values))
