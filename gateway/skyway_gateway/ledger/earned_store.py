"""The SQL of earnings by day, drone or route."""

from collections.abc import Sequence
from datetime import date, timedelta
from typing import Any, Final

from sqlalchemy import ColumnElement, Select, Text, and_, cast, func, literal, select, tuple_
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.runtime.sql.connection import AnyRow
from skyway_gateway.delivery_tables import custody, missions, packages
from skyway_gateway.ledger.earned import By, Earned, EarnedQuery
from skyway_gateway.tables import ledger

_DAY_MS: Final = 86_400_000
_FIRST_DAY: Final = date(1970, 1, 1)


async def earned_page(
    connection: AsyncConnection, query: EarnedQuery, *, month: str
) -> Sequence[AnyRow]:
    """Up to limit + 1 sums of a month, by provider, currency and what they are summed by."""
    lines = _lines(query, month).subquery()
    key = (lines.c.provider_id, lines.c.currency, lines.c.first, lines.c.second)
    statement = select(
        *key,
        func.count(lines.c.delivery_id.distinct()).label("deliveries"),
        func.count(lines.c.mission_id.distinct()).label("missions"),
        func.sum(lines.c.amount).label("amount"),
    )
    if (after := query.after(str, str, str, str)) is not None:
        statement = statement.where(tuple_(*key) > after)
    statement = statement.group_by(*key).order_by(*key).limit(query.limit + 1)
    return (await connection.execute(statement)).all()


def _lines(query: EarnedQuery, month: str) -> Select[*tuple[Any, ...]]:  # columns of every type
    """The lines of a month, each with the two texts by which it is summed."""
    first, second = _KEYS[query.by]
    statement = select(ledger, first.label("first"), second.label("second")).select_from(
        ledger.outerjoin(missions, missions.c.mission_id == ledger.c.mission_id)
        .outerjoin(
            packages,
            and_(packages.c.delivery_id == ledger.c.delivery_id, packages.c.number == 0),
        )
        .outerjoin(
            custody,
            and_(
                custody.c.delivery_id == packages.c.delivery_id,
                custody.c.package_id == packages.c.package_id,
                custody.c.seq == 1,
            ),
        )
    )
    statement = statement.where(ledger.c.month == month)
    if query.provider_id is not None:
        statement = statement.where(ledger.c.provider_id == query.provider_id)
    return statement


#: By what lines are summed. All days of a thousand years have equally many digits.
_KEYS: Final[dict[By, tuple[ColumnElement[str], ColumnElement[str]]]] = {
    "day": (cast(ledger.c.at_ms // _DAY_MS, Text), literal("", Text)),
    "drone": (func.coalesce(missions.c.drone_id, ""), literal("", Text)),
    "route": (
        func.coalesce(custody.c.custodian_id, ""),
        func.coalesce(packages.c.destination_station_id, ""),
    ),
}


def earned_of(row: AnyRow, by: By) -> Earned:
    """The sum of a row."""
    found = Earned(
        provider_id=row.provider_id,
        currency=row.currency,
        deliveries=row.deliveries,
        missions=row.missions,
        amount=int(row.amount),  # sums of integers are decimals on PostgreSQL
    )
    first, second = row.first or None, row.second or None
    if by == "day":
        return found.model_copy(update={"day": _FIRST_DAY + timedelta(days=int(row.first))})
    if by == "drone":
        return found.model_copy(update={"drone_id": first})
    return found.model_copy(update={"from_station_id": first, "to_station_id": second})
