"""The SQL of lists of deliveries, which hold only what the caller may see, and of earnings."""

from collections.abc import Sequence
from datetime import date, timedelta
from typing import Annotated, Any, Final

from pydantic import Field
from sqlalchemy import Select, distinct, exists, func, select
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import ProviderId
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import PageQuery
from skyway.runtime.sql.connection import AnyRow
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.access.store import owned
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, DeliveryState
from skyway_gateway.deliveries.lifecycle.delivery_parts import Waiting
from skyway_gateway.deliveries.reading.views import DayEarnings, EarningsQuery
from skyway_gateway.deliveries.records.delivery_store import with_parts
from skyway_gateway.delivery_tables import deliveries, missions


class DeliveryListQuery(PageQuery):
    """The query of the list of deliveries."""

    state: Annotated[DeliveryState | None, Field(description="Only deliveries in this state.")] = (
        None
    )
    reference: Annotated[
        str | None,
        Field(max_length=200, description="Only deliveries with this reference of the customer's."),
    ] = None


async def page_of(
    connection: AsyncConnection, caller: Caller, query: DeliveryListQuery
) -> Sequence[Delivery]:
    """Up to limit + 1 of the caller's deliveries, the newest first."""
    statement = select(deliveries).where(owned(caller, deliveries.c.customer_id))
    if query.state is not None:
        statement = statement.where(deliveries.c.state == query.state)
    if query.reference is not None:
        statement = statement.where(deliveries.c.reference == query.reference)
    return await _page(connection, statement, query)


async def page_of_provider(
    connection: AsyncConnection, provider_id: ProviderId, query: PageQuery
) -> Sequence[Delivery]:
    """Up to limit + 1 deliveries that a provider's drones fly, with only what these drones do."""
    is_flown = exists().where(
        missions.c.delivery_id == deliveries.c.delivery_id,
        missions.c.provider_id == provider_id,
        missions.c.state != "REFUSED",
    )
    found = await _page(connection, select(deliveries).where(is_flown), query)
    return [_part_of(provider_id, delivery) for delivery in found]


def _part_of(provider_id: ProviderId, delivery: Delivery) -> Delivery:
    """The delivery with the missions, packages and activity of one provider's drones."""
    own = tuple(one for one in delivery.missions if one.provider_id == provider_id)
    mission_ids = {mission.mission_id for mission in own}
    packages = tuple(one for one in delivery.packages if one.mission_id in mission_ids)
    # A delivery has one activity: the latest report of any of its drones.
    activity = delivery.activity if len(own) == len(delivery.missions) else None
    changes = {"missions": own, "packages": packages, "activity": activity}
    return delivery.model_copy(update=changes)


_place = func.row_number().over(
    partition_by=(deliveries.c.network_id, deliveries.c.queue_rank),
    order_by=(deliveries.c.created_ms, deliveries.c.delivery_id),
)
_PLACES: Final = (
    select(deliveries.c.delivery_id, deliveries.c.waits_since_ms, _place.label("place"))
    .where(deliveries.c.waits_since_ms.is_not(None))
    .subquery()
)


async def with_places(connection: AsyncConnection, found: Sequence[Delivery]) -> Sequence[Delivery]:
    """The deliveries; those that wait for a drone show their place."""
    queued = [delivery.delivery_id for delivery in found if delivery.is_queued]
    if not queued:
        return found
    statement = select(_PLACES).where(_PLACES.c.delivery_id.in_(queued))
    rows = {row.delivery_id: row for row in await connection.execute(statement)}
    return [_with_place(delivery, rows.get(delivery.delivery_id)) for delivery in found]


def _with_place(delivery: Delivery, row: AnyRow | None) -> Delivery:
    waiting = row and Waiting(
        place=row.place,
        since_at=ms_to_moment(row.waits_since_ms),
        earliest_start_at=Waiting.earliest_start(delivery.reasons),
    )
    return delivery.model_copy(update={"waiting": waiting})


async def _page(
    connection: AsyncConnection, statement: Select[*tuple[Any, ...]], query: PageQuery
) -> Sequence[Delivery]:
    if (after := query.after_id()) is not None:
        statement = statement.where(deliveries.c.delivery_id < after)
    statement = statement.order_by(deliveries.c.delivery_id.desc()).limit(query.limit + 1)
    return await with_parts(connection, (await connection.execute(statement)).all())


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
