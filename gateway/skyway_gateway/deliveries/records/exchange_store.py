"""The SQL of exchanges: which missions came to a provider or left it, and when."""

from collections.abc import Iterator, Sequence

from sqlalchemy import select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import ProviderId
from skyway.runtime.http.paging import PageQuery
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.delivery_tables import exchanges
from skyway_gateway.notifications.event_store import NumberedEvent


def add_exchanges(tx: Tx, before: Delivery, new: Sequence[NumberedEvent]) -> None:
    """Note, for both providers, each mission whose provider these events of a delivery change."""
    if rows := [*_rows_of(before, new)]:
        tx.add(exchanges, rows)


def _rows_of(before: Delivery, new: Sequence[NumberedEvent]) -> Iterator[dict[str, object]]:
    flown_by = {each.mission_id: each.provider_id for each in before.missions}
    for event in (each.event for each in new):
        if event.data.get("code") != "PROVIDER_CHANGED":
            continue
        mission_id = event.data["mission_id"]
        sides = (("LEFT", flown_by[mission_id]), ("CAME", event.data["provider_id"]))
        for direction, provider_id in sides:
            yield {
                "provider_id": provider_id,
                "event_id": event.event_id,
                "delivery_id": event.delivery_id,
                "mission_id": mission_id,
                "direction": direction,
                "at_ms": moment_to_ms(event.occurred_at),
            }


async def page_of(
    connection: AsyncConnection, provider_id: ProviderId, query: PageQuery
) -> Sequence[AnyRow]:
    """Up to limit + 1 exchanges of a provider, the newest first."""
    statement = select(exchanges).where(exchanges.c.provider_id == provider_id)
    if (after := query.after_id()) is not None:
        statement = statement.where(exchanges.c.event_id < after)
    statement = statement.order_by(exchanges.c.event_id.desc()).limit(query.limit + 1)
    return (await connection.execute(statement)).all()
