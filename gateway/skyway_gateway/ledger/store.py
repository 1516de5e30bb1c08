"""The SQL of the ledger: its lines, their sums by party, and the months that are closed.

Rows are only added. A line counts in the month in which it is written, so that no line comes into
a month that was closed days after its end.
"""

from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Any, Final, get_args

from sqlalchemy import (
    CompoundSelect,
    Select,
    case,
    exists,
    func,
    insert,
    literal,
    or_,
    select,
    tuple_,
    union_all,
)
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.statement_event import ClosedTotal
from skyway.delivery.line_items import LineKind
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.delivery_tables import is_live_row
from skyway_gateway.ledger.line import LedgerLine
from skyway_gateway.ledger.statement import (
    LineQuery,
    Statement,
    StatementItems,
    StatementQuery,
)
from skyway_gateway.tables import closed_months, closed_totals, ledger, webhooks

#: The column that names a party, by its role.
_PARTIES: Final = {"customer": ledger.c.customer_id, "provider": ledger.c.provider_id}
_KINDS: Final = (*get_args(LineKind), "CORRECTION")

_Query = Select[*tuple[Any, ...]]  # columns of every type


def add_lines(tx: Tx, lines: Iterable[LedgerLine]) -> None:
    """Add lines at the end of the transaction; a line that exists already is refused."""
    tx.add(ledger, [_row_of(each) for each in lines])


def _row_of(line: LedgerLine) -> dict[str, Any]:  # values of every type
    return {**line.model_dump(exclude={"at", "livemode"}), "at_ms": moment_to_ms(line.at)}


def _line_of(row: AnyRow) -> LedgerLine:
    values = dict(row._mapping)
    at = ms_to_moment(values.pop("at_ms"))
    return LedgerLine(**values, at=at)


async def lines_page(
    connection: AsyncConnection, query: LineQuery, *, month: str
) -> Sequence[LedgerLine]:
    """Up to limit + 1 lines of a month, by mission and number."""
    statement = select(ledger).where(ledger.c.month == month)
    columns = _PARTIES.values() if query.role is None else [_PARTIES[query.role]]
    if query.party_id is None:
        statement = statement.where(is_live_row(ledger.c.customer_id))
    else:
        statement = statement.where(or_(*(column == query.party_id for column in columns)))
    if query.delivery_id is not None:
        statement = statement.where(ledger.c.delivery_id == query.delivery_id)
    key = tuple_(ledger.c.mission_id, ledger.c.number)
    if (after := query.after(str, int)) is not None:
        statement = statement.where(key > after)
    statement = statement.order_by(ledger.c.mission_id, ledger.c.number).limit(query.limit + 1)
    return [_line_of(row) for row in await connection.execute(statement)]


async def lock_lines(tx: Tx, mission_id: str) -> list[LedgerLine]:
    """All lines of a mission in order, locked: nobody adds another line meanwhile."""
    statement = select(ledger).where(ledger.c.mission_id == mission_id).order_by(ledger.c.number)
    await tx.execute(statement.with_for_update())
    # Read after the lock: who waited for it does not see in the same statement what was added.
    return [_line_of(row) for row in await tx.execute(statement)]


def _sums(role: str) -> _Query:
    """The sums of each party of a role, by month and currency."""
    party = _PARTIES[role]
    by_kind = (
        func.sum(case((ledger.c.kind == kind, ledger.c.amount), else_=0)).label(kind.lower())
        for kind in _KINDS
    )
    return select(
        ledger.c.month,
        literal(role).label("role"),
        party.label("party_id"),
        ledger.c.currency,
        func.sum(ledger.c.amount).label("amount"),
        func.count().label("lines"),
        func.count(ledger.c.delivery_id.distinct()).label("deliveries"),
        *by_kind,
    ).group_by(ledger.c.month, party, ledger.c.currency)


def sums_of(
    month: str, *, role: str | None = None, party_id: str | None = None
) -> CompoundSelect[*tuple[Any, ...]]:
    """The sums of a month: one row for each party and currency."""
    asked = []
    for each in _PARTIES if role is None else (role,):
        statement = _sums(each).where(ledger.c.month == month)
        if party_id is not None:
            statement = statement.where(_PARTIES[each] == party_id)
        asked.append(statement)
    return union_all(*asked)


async def statements_page(
    connection: AsyncConnection, query: StatementQuery, *, month: str
) -> Sequence[Statement]:
    """Up to limit + 1 statements of a month, by role, party and currency.

    Those of test parties are shown only where one is named.
    """
    found = sums_of(month, role=query.role, party_id=query.party_id).subquery()
    key = (found.c.role, found.c.party_id, found.c.currency)
    closed_ms = (
        select(closed_months.c.closed_ms).where(closed_months.c.month == month).scalar_subquery()
    )
    statement = select(found, closed_ms.label("closed_ms"))
    if query.party_id is None:
        statement = statement.where(
            is_live_row(found.c.party_id),
            ~found.c.party_id.startswith("prv_test_", autoescape=True),
        )
    if (after := query.after(str, str, str)) is not None:
        statement = statement.where(tuple_(*key) > after)
    statement = statement.order_by(*key).limit(query.limit + 1)
    return [_statement_of(row) for row in await connection.execute(statement)]


def _statement_of(row: AnyRow) -> Statement:
    return Statement(
        month=row.month,
        role=row.role,
        party_id=row.party_id,
        currency=row.currency,
        amount=int(row.amount),  # sums of integers are decimals on PostgreSQL
        deliveries=row.deliveries,
        lines=row.lines,
        items=StatementItems(**{kind.lower(): int(getattr(row, kind.lower())) for kind in _KINDS}),
        closed_at=None if row.closed_ms is None else ms_to_moment(row.closed_ms),
    )


async def month_to_close(connection: AsyncConnection, *, before: str) -> str | None:
    """The first month with lines that is not closed and comes before this month."""
    last = select(func.coalesce(func.max(closed_months.c.month), "")).scalar_subquery()
    statement = select(func.min(ledger.c.month)).where(
        ledger.c.month > last, ledger.c.month < before
    )
    found: str | None = (await connection.execute(statement)).scalar()
    return found


async def close_month(tx: Tx, month: str, *, at: datetime) -> bool:
    """Close a month, and store the total of each party; False if another replica was faster."""
    row = {"month": month, "closed_ms": moment_to_ms(at)}
    closed = await tx.execute(tx.insert(closed_months).values(row).on_conflict_do_nothing())
    if closed.rowcount != 1:
        return False
    sums = sums_of(month).subquery()
    names = [column.name for column in closed_totals.columns]
    chosen = select(*(sums.c[name] for name in names))
    await tx.execute(insert(closed_totals).from_select(names, chosen))
    return True


async def totals_of_listeners(tx: Tx, month: str) -> dict[str, list[ClosedTotal]]:
    """The totals of a closed month by customer, for customers with a webhook."""
    listens = exists().where(
        webhooks.c.customer_id == closed_totals.c.party_id,
        webhooks.c.state == "ACTIVE",
        is_live_row(webhooks.c.customer_id),
    )
    statement = (
        select(closed_totals)
        .where(closed_totals.c.month == month, closed_totals.c.role == "customer", listens)
        .order_by(closed_totals.c.party_id, closed_totals.c.currency)
    )
    found: dict[str, list[ClosedTotal]] = {}
    for row in await tx.execute(statement):
        total = ClosedTotal(currency=row.currency, amount=row.amount, lines=row.lines)
        found.setdefault(row.party_id, []).append(total)
    return found
