"""The SQL of earnings."""

from datetime import date, timedelta
from typing import Final

from sqlalchemy import distinct, func, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import ProviderId
from skyway.units import moment_to_ms
from skyway_gateway.deliveries.reading.earnings import DayEarnings, EarningsQuery
from skyway_gateway.tables import missions

_DAY_MS: Final = 86_400_000
_FIRST_DAY: Final = date(1970, 1, 1)


async def days_of(
    connection: AsyncConnection, provider_id: ProviderId, query: EarningsQuery
) -> tuple[DayEarnings, ...]:
    """A provider's completed missions by the day on which they ended, the first day first."""
    day = (missions.c.ended_ms // _DAY_MS).label("day")
    statement = select(
        day,
        missions.c.currency,
        func.count(distinct(missions.c.delivery_id)).label("deliveries"),
        func.count().label("missions"),
        func.sum(missions.c.price_amount).label("amount"),
    ).where(missions.c.provider_id == provider_id, missions.c.state == "COMPLETED")
    if query.from_at is not None:
        statement = statement.where(missions.c.ended_ms >= moment_to_ms(query.from_at))
    if query.to_at is not None:
        statement = statement.where(missions.c.ended_ms < moment_to_ms(query.to_at))
    # The currency used last comes last within its day.
    statement = statement.group_by(day, missions.c.currency).order_by(
        day, func.max(missions.c.ended_ms)
    )
    return tuple(
        DayEarnings(
            day=_FIRST_DAY + timedelta(days=row.day),
            currency=row.currency,
            deliveries=row.deliveries,
            missions=row.missions,
            amount=int(row.amount),
        )
        for row in await connection.execute(statement)
    )
