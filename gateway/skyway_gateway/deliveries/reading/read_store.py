"""The SQL of lists of deliveries: each query returns only what the caller may see."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Select, exists, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import ProviderId
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import PageQuery
from skyway_gateway.access.ownership_store import owned
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.states import DeliveryState
from skyway_gateway.deliveries.records.delivery_store import with_parts
from skyway_gateway.tables import deliveries, missions


@dataclass(frozen=True, slots=True)
class DeliveryFilter:
    """Which deliveries a list shows."""

    state: DeliveryState | None = None
    reference: str | None = None


async def page_of(
    connection: AsyncConnection, caller: Caller, query: PageQuery, requested: DeliveryFilter
) -> Sequence[Delivery]:
    """Up to limit + 1 of the caller's deliveries, the newest first."""
    statement = select(deliveries).where(owned(caller, deliveries.c.customer_id))
    if requested.state is not None:
        statement = statement.where(deliveries.c.state == requested.state)
    if requested.reference is not None:
        statement = statement.where(deliveries.c.reference == requested.reference)
    return await _page(connection, statement, query)


async def page_of_provider(
    connection: AsyncConnection, provider_id: ProviderId, query: PageQuery
) -> Sequence[Delivery]:
    """Up to limit + 1 deliveries that a provider's drones fly, with only its own missions."""
    is_flown = exists().where(
        missions.c.delivery_id == deliveries.c.delivery_id,
        missions.c.provider_id == provider_id,
        missions.c.state != "REFUSED",
    )
    found = await _page(connection, select(deliveries).where(is_flown), query)
    return [
        delivery.model_copy(
            update={"missions": tuple(m for m in delivery.missions if m.provider_id == provider_id)}
        )
        for delivery in found
    ]


async def _page(
    connection: AsyncConnection, statement: Select[*tuple[Any, ...]], query: PageQuery
) -> Sequence[Delivery]:
    if (after := query.after(str)) is not None:
        statement = statement.where(deliveries.c.delivery_id < after[0])
    statement = statement.order_by(deliveries.c.delivery_id.desc()).limit(query.limit + 1)
    return await with_parts(connection, (await connection.execute(statement)).all())
